#include "shapes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/surface/extract.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <random>
#include <set>
#include <sstream>

using palpate::core::Error;
using palpate::core::ErrorKind;
using palpate::core::TriangleMesh;
using palpate::surface::load_mesh;
using palpate::surface::MeshSpace;
using palpate::surface::save_mesh;
using palpate::testing::TemporaryFolder;
using ::testing::HasSubstr;
namespace shapes = palpate::surface::shapes;

namespace {

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  return bytes.str();
}

std::filesystem::path written(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

/// A tetrahedron, wound outwards: volume 1/6 of 10 x 20 x 30.
TriangleMesh tetrahedron() {
  TriangleMesh mesh;
  mesh.vertices_mm = {{0, 0, 0}, {10, 0, 0}, {0, 20, 0}, {0, 0, 30}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  mesh.normals = palpate::core::vertex_normals(mesh);
  mesh.intensities = {1.5F, 2.5F, 3.5F, 4.5F};
  return mesh;
}

constexpr const char* obj_tetrahedron =
    "v 0 0 0\nv 10 0 0\nv 0 20 0\nv 0 0 30\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

struct Refused {
  ErrorKind kind = ErrorKind::internal;
  std::string code = "none";
  std::string text;
};
Refused refused(const std::filesystem::path& path) {
  try {
    load_mesh(path);
  } catch (const Error& error) {
    return {error.kind(), error.code(), error.what()};
  }
  return {};
}

void expect_tetrahedron(const TriangleMesh& mesh) {
  EXPECT_EQ(mesh.vertices_mm.size(), 4U);
  EXPECT_EQ(mesh.triangles.size(), 4U);
  EXPECT_EQ(mesh.normals.size(), 4U);
  EXPECT_TRUE(shapes::closed_and_manifold(mesh));
  EXPECT_NEAR(shapes::volume_of(mesh), 1000.0, 1e-9);  // whole numbers: exact but for the last sum
}

std::set<std::array<float, 3>> places_of(const TriangleMesh& mesh) {
  std::set<std::array<float, 3>> places;
  for (const auto& vertex : mesh.vertices_mm) places.insert({vertex.x(), vertex.y(), vertex.z()});
  return places;
}

}  // namespace

TEST(MeshFiles, ComeBackAsTheyWereSaved) {
  const TemporaryFolder folder;
  TriangleMesh mesh = tetrahedron();
  for (auto& vertex : mesh.vertices_mm) vertex += Eigen::Vector3f(0.1F, -1.0F / 3.0F, 123.456F);
  for (const char* name : {"a.stl", "a.ply", "a.obj", "a.vtp", "UPPER.STL"}) {
    SCOPED_TRACE(name);
    save_mesh(folder / name, mesh);
    const auto loaded = load_mesh(folder / name);
    EXPECT_EQ(loaded.mesh.triangles.size(), 4U);
    EXPECT_TRUE(shapes::closed_and_manifold(loaded.mesh));
    EXPECT_EQ(places_of(loaded.mesh), places_of(mesh));  // every format keeps all bits of a float
    EXPECT_GT(shapes::volume_of(loaded.mesh), 0.0);
    EXPECT_EQ(loaded.space, MeshSpace::lps);
    EXPECT_EQ(loaded.space_reason, "stated by SPACE=LPS in the file");
  }
  for (const char* name : {"a.ply", "a.vtp"})
    EXPECT_EQ(load_mesh(folder / name).mesh.intensities.size(), 4U) << name;
  std::size_t files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) ++files;
  EXPECT_EQ(files, 5U);  // nothing is left beside them
}

TEST(MeshFiles, SavingSaysWhereItCannot) {
  const TemporaryFolder folder;
  EXPECT_THROW(save_mesh(folder / "a.off", tetrahedron()), Error);
  try {
    save_mesh(folder / "missing/a.stl", tetrahedron());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::output);
    EXPECT_THAT(error.what(), HasSubstr("missing/a.stl"));
  }
  written(folder / "kept.obj", obj_tetrahedron);
  std::filesystem::create_directory(folder / "is-folder.obj");
  EXPECT_THROW(save_mesh(folder / "is-folder.obj", tetrahedron()), Error);
  std::size_t entries = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) ++entries;
  EXPECT_EQ(entries, 2U);
}

TEST(MeshFiles, RasIsTurnedAndTheChoiceWins) {
  const TemporaryFolder folder;
  const auto stated =
      written(folder / "ras.obj", std::string("# made elsewhere; SPACE=RAS\n") + obj_tetrahedron);
  const auto ras = load_mesh(stated);
  EXPECT_EQ(ras.space, MeshSpace::ras);
  EXPECT_EQ(ras.space_reason, "stated by SPACE=RAS in the file");
  expect_tetrahedron(ras.mesh);
  EXPECT_TRUE(places_of(ras.mesh).count({-10.0F, 0.0F, 0.0F}) == 1);
  EXPECT_TRUE(places_of(ras.mesh).count({0.0F, -20.0F, 0.0F}) == 1);
  EXPECT_TRUE(places_of(ras.mesh).count({0.0F, 0.0F, 30.0F}) == 1);
  EXPECT_TRUE(places_of(load_mesh(stated, MeshSpace::lps).mesh).count({10.0F, 0.0F, 0.0F}) == 1);
  const auto silent = written(folder / "silent.obj", obj_tetrahedron);
  EXPECT_EQ(load_mesh(silent).space, MeshSpace::lps);
  EXPECT_EQ(load_mesh(silent).space_reason, "assumed");
  EXPECT_EQ(load_mesh(silent, MeshSpace::ras).space_reason, "chosen");

  // The same words where each other format keeps them.
  const auto restated = [&](const char* name) {
    save_mesh(folder / name, tetrahedron());
    std::string bytes = bytes_of(folder / name);
    const auto at = bytes.find("SPACE=LPS");
    if (at == std::string::npos) return std::string("no SPACE in ") + name;
    bytes.replace(at, 9, "SPACE=RAS");
    return load_mesh(written(folder / name, bytes)).space_reason;
  };
  EXPECT_EQ(restated("b.stl"), "stated by SPACE=RAS in the file");
  EXPECT_EQ(restated("b.ply"), "stated by SPACE=RAS in the file");
  const auto legacy = written(folder / "b.vtk",
                              "# vtk DataFile Version 3.0\n3D model. SPACE=RAS\nASCII\nDATASET POLYDATA\n"
                              "POINTS 3 float\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\n");
  EXPECT_EQ(load_mesh(legacy).space, MeshSpace::ras);
}

TEST(MeshFiles, ReadsTheFormsOfEachFormat) {
  const TemporaryFolder folder;
  expect_tetrahedron(load_mesh(written(folder / "plain.obj", obj_tetrahedron)).mesh);
  // Split points, normals, texture, negative indices, unused points, CR LF.
  expect_tetrahedron(
      load_mesh(written(folder / "split.obj",
                        "v 0 0 0\r\nv 10 0 0\r\nv 0 20 0\r\nv 0 0 30\r\nv 7 7 7\r\nv -0.0 0 0\r\n"
                        "vn 0 0 1\r\nvt 0 0\r\nf 1/1/1 3/1/1 2/1/1\r\nf 6//1 2//1 4//1\r\n"
                        "f -1 -3 -4\r\nf 2 3 4\r\nf 1 1 2\r\n"))
          .mesh);
  const std::string facet = "facet normal 0 0 0\n outer loop\n";
  std::string ascii = "solid thing SPACE=LPS\n";
  for (const char* corners :
       {"vertex 0 0 0\nvertex 0 20 0\nvertex 10 0 0\n", "vertex 0 0 0\nvertex 1e1 0 0\nvertex 0 0 30\n",
        "vertex 0 0 0\nvertex 0 0 30\nvertex 0 20 0\n", "vertex 10 0 0\nvertex 0 20 0\nvertex 0 0 30\n"})
    ascii += facet + corners + "endloop\nendfacet\n";
  expect_tetrahedron(load_mesh(written(folder / "a.stl", ascii + "endsolid thing\n")).mesh);
  expect_tetrahedron(load_mesh(written(folder / "b.stl", ascii + "end solid\n")).mesh);
  // A binary file whose header begins with "solid".
  save_mesh(folder / "c.stl", tetrahedron());
  std::string binary = bytes_of(folder / "c.stl");
  binary.replace(0, 7, "solid ab");
  binary.erase(8, 1);
  expect_tetrahedron(load_mesh(written(folder / "c.stl", binary)).mesh);

  expect_tetrahedron(
      load_mesh(written(folder / "a.ply",
                        "ply\nformat ascii 1.0\nelement vertex 4\nproperty uchar red\nproperty double x\n"
                        "property float y\nproperty float z\nelement edge 1\nproperty int vertex1\n"
                        "element face 4\nproperty list uchar int vertex_index\nend_header\n"
                        "1 0 0 0\n2 10 0 0\n3 0 20 0\n4 0 0 30\n7\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"))
          .mesh);
  const std::string legacy =
      "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n"
      "0 0 0 10 0 0 0 20 0 0 0 30\n";
  expect_tetrahedron(
      load_mesh(written(folder / "a.vtk",
                        legacy + "POLYGONS 4 16\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\nPOINT_DATA 4\n"))
          .mesh);
  expect_tetrahedron(
      load_mesh(written(folder / "b.vtk", legacy + "METADATA\nINFORMATION 0\n\nPOLYGONS 5 12\n"
                                                   "OFFSETS vtktypeint64\n0 3 6 9 12\n"
                                                   "CONNECTIVITY vtktypeint64\n0 2 1 0 1 3 0 3 2 1 2 3\n"))
          .mesh);
  // The tetrahedron as one strip: 0 2 1 | 2 3 1 turned | ... and its last face.
  expect_tetrahedron(
      load_mesh(written(folder / "c.vtk", legacy + "TRIANGLE_STRIPS 1 7\n6 0 2 1 3 0 2\n")).mesh);
  // XML under the other ending.
  save_mesh(folder / "x.vtp", tetrahedron());
  std::filesystem::rename(folder / "x.vtp", folder / "x.vtk");
  expect_tetrahedron(load_mesh(folder / "x.vtk").mesh);
}

TEST(MeshFiles, RefusesWithWords) {
  const TemporaryFolder folder;
  const auto code = [&](const char* name, const std::string& bytes) {
    const Refused answer = refused(written(folder / name, bytes));
    EXPECT_EQ(answer.kind, ErrorKind::input) << name;
    EXPECT_THAT(answer.text, HasSubstr((folder / name).string()));
    return answer.code;
  };
  EXPECT_EQ(code("a.off", "OFF\n3 1 0\n"), "unsupported");
  EXPECT_EQ(code("none", "v 0 0 0\n"), "unsupported");
  EXPECT_THAT(refused(folder / "a.off").text, HasSubstr(".stl, .ply, .obj, .vtp or .vtk"));
  EXPECT_EQ(refused(folder / "missing.stl").code, "unreadable");
  EXPECT_EQ(refused(folder.path()).code, "unsupported");
  EXPECT_EQ(code("empty.stl", ""), "unreadable");
  EXPECT_EQ(code("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "damaged");
  EXPECT_EQ(code("huge.obj", "v 1e300 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "damaged");
  EXPECT_EQ(code("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"), "damaged");
  EXPECT_EQ(code("back.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n"), "damaged");
  EXPECT_EQ(code("points.obj", "v 0 0 0\nv 1 0 0\np 1\n"), "no-polygons");
  EXPECT_EQ(code("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 2\n"), "no-polygons");
  EXPECT_EQ(code("cut.stl", std::string(80, 'x') + std::string("\2\0\0\0", 4) + std::string(60, '\0')),
            "damaged");
  EXPECT_EQ(code("many.stl", std::string(80, 'x') + "\xff\xff\xff\xff"), "damaged");
  EXPECT_EQ(code("cut-ascii.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"), "damaged");
  const Refused strips = refused(written(
      folder / "strips.ply",
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n4 "
      "0 1 2 3\n"));
  EXPECT_EQ(strips.code, "no-polygons");
  EXPECT_THAT(strips.text, HasSubstr("4 points"));
  EXPECT_THAT(strips.text, HasSubstr("strips"));
  EXPECT_EQ(
      code("many.ply", "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nend_header\n"),
      "damaged");
  EXPECT_EQ(
      code("list.ply",
           "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
           "element face 1\nproperty list int int vertex_index\nend_header\n0 0 0\n4000000000 0 0 0\n"),
      "damaged");
  EXPECT_EQ(code("grid.vtk", "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n"),
            "unsupported");
  EXPECT_EQ(
      code("many.vtk", "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 88888888888 float\n"),
      "damaged");
  EXPECT_EQ(code("not.vtk", "something else altogether\n"), "damaged");
  EXPECT_EQ(code("image.vtp", "<?xml version=\"1.0\"?><VTKFile type=\"ImageData\"></VTKFile>"),
            "unsupported");
  EXPECT_EQ(
      code("many.vtp",
           "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"9999999999999\" NumberOfPolys=\"1\">"
           "</Piece></PolyData></VTKFile>"),
      "damaged");
}

// Bytes changed, cut off and repeated at random: a mesh or a refusal, never a
// crash, and nothing printed. The seed is fixed.
TEST(MeshFiles, WhatEndsVtksReaderIsRefusedBefore) {
  const TemporaryFolder folder;
  save_mesh(folder / "whole.vtp", tetrahedron());
  const std::string whole = bytes_of(folder / "whole.vtp");
  for (const auto& [right, wrong] : {std::pair("<Array type=\"String\"", "<Array typ-=\"String\""),
                                     std::pair("<Array type=\"String\"", "<Array type=\"Strung\""),
                                     std::pair("header_type=\"UInt64\"", "header_tipe=\"UInt64\"")}) {
    std::string bytes = whole;
    const auto at = bytes.find(right);
    ASSERT_NE(at, std::string::npos) << right;
    bytes.replace(at, std::string(right).size(), wrong);
    written(folder / "damaged.vtp", bytes);
    try {
      load_mesh(folder / "damaged.vtp");
      ADD_FAILURE() << wrong;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::input) << wrong;
    }
  }
}

TEST(MeshFiles, DamagedFilesNeverCrashOrPrint) {
  const TemporaryFolder folder;
  TriangleMesh mesh = tetrahedron();
  for (const char* name : {"a.stl", "a.ply", "a.obj", "a.vtp"}) save_mesh(folder / name, mesh);
  written(folder / "a.vtk",
          "# vtk DataFile Version 5.1\ntitle\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 10 0 0 0 20 0 0 "
          "0 30\n"
          "POLYGONS 5 12\nOFFSETS vtktypeint64\n0 3 6 9 12\nCONNECTIVITY vtktypeint64\n0 2 1 0 1 3 0 3 2 1 2 "
          "3\n");
  // The same in the plain form of the XML, where every number can be hit.
  written(
      folder / "plain.vtp",
      "<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\"><PolyData>"
      "<Piece NumberOfPoints=\"4\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
      "NumberOfPolys=\"4\">"
      "<Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">"
      "0 0 0 10 0 0 0 20 0 0 0 30</DataArray></Points><Polys>"
      "<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 2 1 0 1 3 0 3 2 1 2 3</DataArray>"
      "<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">3 6 9 12</DataArray></Polys>"
      "</Piece></PolyData></VTKFile>");
  expect_tetrahedron(load_mesh(folder / "plain.vtp").mesh);
  std::mt19937 random(20240601);
  std::size_t read = 0;
  std::size_t refusals = 0;
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  std::vector<std::string> names{"a.stl", "a.ply", "a.obj", "a.vtk", "plain.vtp"};
#ifndef __SANITIZE_ADDRESS__
  // VTK believes the sizes of its blocks; the sanitizer ends the program where new would throw.
  names.emplace_back("a.vtp");
#endif
  for (const auto& name : names) {
    const std::string whole = bytes_of(folder / name);
    const auto damaged_path =
        folder / (std::string("damaged") + std::filesystem::path(name).extension().string());
    for (int trial = 0; trial < palpate::testing::repetitions(150, 3000); ++trial) {
      std::string bytes = whole;
      if (trial % 5 == 0) bytes.resize(random() % bytes.size());
      const auto changes = trial % 5 == 0 ? 0U : 1 + random() % 4;
      for (unsigned change = 0; change < changes; ++change) {
        const std::size_t at = random() % bytes.size();
        if (random() % 3 == 0) {
          bytes[at] = static_cast<char>(random());
        } else if (random() % 2 == 0) {
          bytes[at] = "0123456789- .\n\"<"[random() % 16];
        } else {
          bytes.insert(at, bytes.substr(random() % bytes.size(), random() % 9));
        }
      }
      written(damaged_path, bytes);
      try {
        const auto loaded = load_mesh(damaged_path);
        ++read;
        for (const auto& triangle : loaded.mesh.triangles)
          for (const auto corner : triangle) ASSERT_LT(corner, loaded.mesh.vertices_mm.size());
      } catch (const Error& error) {
        ++refusals;
        ASSERT_EQ(error.kind(), ErrorKind::input) << error.what();
      }
    }
  }
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_GT(read, 60U);  // many changes only move a vertex
  EXPECT_GT(refusals, 200U);
}

TEST(MeshFiles, RealMeshesHaveTheirFaces) {
  PALPATE_TEST_SCAN(dragon, "mesh/dragon.obj");
  PALPATE_TEST_SCAN(armadillo, "mesh/Armadillo_simplified.obj");
  PALPATE_TEST_SCAN(liver, "mesh/liver-smooth.obj");
  PALPATE_TEST_SCAN(bunny, "mesh/Bunny.stl");
  PALPATE_TEST_SCAN(unused, "mesh/SOFA_collision_no_face.obj");
  PALPATE_TEST_SCAN(off, "mesh/aneurysm3D_1.off");
  EXPECT_EQ(load_mesh(dragon).mesh.triangles.size(), 2564U);
  const TriangleMesh armadillo_mesh = load_mesh(armadillo).mesh;
  EXPECT_EQ(armadillo_mesh.triangles.size(), 25200U);
  EXPECT_EQ(armadillo_mesh.vertices_mm.size(), 12602U);  // not the 75,600 that VTK splits it into
  EXPECT_TRUE(shapes::closed_and_manifold(armadillo_mesh));
  EXPECT_EQ(load_mesh(liver).mesh.triangles.size(), 4384U);
  EXPECT_EQ(load_mesh(bunny).mesh.triangles.size(), 2728U);
  const TriangleMesh used = load_mesh(unused).mesh;
  EXPECT_LT(used.vertices_mm.size(), 466U);  // points that no face uses are left out
  std::vector<bool> met(used.vertices_mm.size());
  for (const auto& triangle : used.triangles)
    for (const auto corner : triangle) met[corner] = true;
  EXPECT_TRUE(std::all_of(met.begin(), met.end(), [](bool vertex) { return vertex; }));
  EXPECT_EQ(refused(off).code, "unsupported");
}

TEST(MeshFiles, PointsAndLinksAreWrittenWithTheirValues) {
  const TemporaryFolder folder;
  palpate::model::Tissue tissue;
  tissue.points.positions_mm = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  tissue.points.intensities = {5, 6, 7};
  tissue.points.center_mm = {10, 20, 30};
  tissue.links.pairs = {{0, 1}, {1, 2}};
  auto positions = tissue.points.positions_mm;
  positions[1].z() += 0.5F;
  palpate::surface::save_points(folder / "points.vtp", tissue, positions);
  const std::string bytes = bytes_of(folder / "points.vtp");
  EXPECT_THAT(bytes, HasSubstr("NumberOfPoints=\"3\""));
  EXPECT_THAT(bytes, HasSubstr("NumberOfLines=\"2\""));
  EXPECT_THAT(bytes, HasSubstr("Name=\"displacement_mm\" NumberOfComponents=\"3\""));
  EXPECT_THAT(bytes, HasSubstr("Name=\"intensity\""));
  // The largest displacement's length stands in the file's own range.
  EXPECT_THAT(bytes, HasSubstr("RangeMax=\"0.5\""));
  EXPECT_EQ(refused(folder / "points.vtp").code, "no-polygons");  // points and lines are no surface
  positions.pop_back();
  EXPECT_THROW(palpate::surface::save_points(folder / "b.vtp", tissue, positions), Error);
  EXPECT_THROW(palpate::surface::save_points(folder / "b.ply", tissue, tissue.points.positions_mm), Error);
}
