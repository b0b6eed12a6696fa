#include "mesh_source.hpp"
#include "vtk_support.hpp"

#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"
#include "palpate/surface/extract.hpp"

#include <Eigen/Geometry>
#include <vtkCellArray.h>
#include <vtkCommand.h>
#include <vtkFieldData.h>
#include <vtkFloatArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStringArray.h>
#include <vtkXMLPolyDataWriter.h>

#include <charconv>
#include <cstring>

namespace palpate::surface {
namespace {

using core::Error;
using core::ErrorKind;
using core::write_file;

template <typename T>
void append_binary(std::string& out, const T& value) {
  std::array<char, sizeof(T)> bytes{};
  std::memcpy(bytes.data(), &value, sizeof(T));  // little-endian, as all machines that this runs on
  out.append(bytes.data(), bytes.size());
}

void append_place(std::string& out, const Eigen::Vector3f& place) {
  for (int axis = 0; axis < 3; ++axis) append_binary(out, place[axis]);
}

std::string stl_of(const core::TriangleMesh& mesh) {
  std::string out = "Palpate surface, mm, SPACE=LPS";
  constexpr std::size_t header_bytes = 80;
  out.resize(header_bytes, ' ');
  append_binary(out, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.vertices_mm[triangle[0]];
    const Eigen::Vector3f& b = mesh.vertices_mm[triangle[1]];
    const Eigen::Vector3f& c = mesh.vertices_mm[triangle[2]];
    append_place(out, (b - a).cross(c - a).normalized());
    append_place(out, a);
    append_place(out, b);
    append_place(out, c);
    append_binary(out, std::uint16_t{0});
  }
  return out;
}

std::string ply_of(const core::TriangleMesh& mesh) {
  const bool normals = mesh.normals.size() == mesh.vertices_mm.size();
  const bool intensities = mesh.intensities.size() == mesh.vertices_mm.size();
  std::string out = "ply\nformat binary_little_endian 1.0\ncomment Palpate surface, mm\ncomment SPACE=LPS\n";
  out += "element vertex " + std::to_string(mesh.vertices_mm.size());
  out += "\nproperty float x\nproperty float y\nproperty float z\n";
  if (normals) out += "property float nx\nproperty float ny\nproperty float nz\n";
  if (intensities) out += "property float intensity\n";
  out += "element face " + std::to_string(mesh.triangles.size()) +
         "\nproperty list uchar int vertex_indices\nend_header\n";
  for (std::size_t vertex = 0; vertex < mesh.vertices_mm.size(); ++vertex) {
    append_place(out, mesh.vertices_mm[vertex]);
    if (normals) append_place(out, mesh.normals[vertex]);
    if (intensities) append_binary(out, mesh.intensities[vertex]);
  }
  for (const auto& triangle : mesh.triangles) {
    out += '\3';
    for (const auto corner : triangle) append_binary(out, corner);
  }
  return out;
}

/// The shortest digits that read back as the same float, in any locale.
void append_number(std::string& out, float value) {
  std::array<char, 32> digits{};
  const auto result = std::to_chars(digits.data(), digits.data() + digits.size(), value);
  out += ' ';
  out.append(digits.data(), result.ptr);
}

std::string obj_of(const core::TriangleMesh& mesh) {
  const bool normals = mesh.normals.size() == mesh.vertices_mm.size();
  std::string out = "# Palpate surface, mm\n# SPACE=LPS\n";
  const auto append_lines = [&](const char* key, const std::vector<Eigen::Vector3f>& vectors) {
    for (const auto& vector : vectors) {
      out += key;
      for (int axis = 0; axis < 3; ++axis) append_number(out, vector[axis]);
      out += '\n';
    }
  };
  append_lines("v", mesh.vertices_mm);
  if (normals) append_lines("vn", mesh.normals);
  for (const auto& triangle : mesh.triangles) {
    out += 'f';
    for (const auto corner : triangle) {
      const std::string number = std::to_string(std::size_t{corner} + 1);
      out += ' ' + number;
      if (normals) out += "//" + number;
    }
    out += '\n';
  }
  return out;
}

std::string vtp_of(vtkPolyData* data, const std::filesystem::path& path) {
  vtkNew<vtkStringArray> space;
  space->SetName("SPACE");
  space->InsertNextValue("LPS");
  data->GetFieldData()->AddArray(space);
  ErrorWatch errors;
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->AddObserver(vtkCommand::ErrorEvent, errors.command());
  writer->AddObserver(vtkCommand::WarningEvent, errors.command());
  writer->SetInputData(data);
  writer->SetHeaderTypeToUInt64();
  writer->SetCompressionLevel(1);  // half the size for little time; more takes many times longer
  writer->SetDataModeToAppended();
  writer->EncodeAppendedDataOff();
  writer->WriteToOutputStringOn();
  writer->Write();
  if (errors.failed() || writer->GetErrorCode() != 0)
    throw Error(ErrorKind::output, "write-failed", path.string() + " cannot be written.", errors.text());
  return writer->GetOutputString();
}

}  // namespace

void save_mesh(const std::filesystem::path& path, const core::TriangleMesh& mesh) {
  const std::string ending = lower_case(path.extension().string());
  if (ending == ".stl") return write_file(path, stl_of(mesh));
  if (ending == ".ply") return write_file(path, ply_of(mesh));
  if (ending == ".obj") return write_file(path, obj_of(mesh));
  if (ending == ".vtp") return write_file(path, vtp_of(to_vtk(mesh), path));
  core::throw_usage("A surface is written as .vtp, .stl, .ply or .obj, not as \"" + path.filename().string() +
                    "\".");
}

void save_points(const std::filesystem::path& path, const model::Tissue& tissue,
                 const std::vector<Eigen::Vector3f>& positions_mm) {
  if (lower_case(path.extension().string()) != ".vtp")
    core::throw_usage("Points are written as .vtp, not as \"" + path.filename().string() + "\".");
  const model::PointCloud& cloud = tissue.points;
  if (positions_mm.size() != cloud.size())
    throw Error(ErrorKind::internal, "point-count", "The positions to save are not those of this tissue.");
  const auto count = static_cast<vtkIdType>(cloud.size());
  vtkNew<vtkPoints> points;
  points->SetNumberOfPoints(count);
  vtkNew<vtkFloatArray> displacement;
  displacement->SetName("displacement_mm");
  displacement->SetNumberOfComponents(3);
  displacement->SetNumberOfTuples(count);
  vtkNew<vtkFloatArray> intensity;
  intensity->SetName("intensity");
  intensity->SetNumberOfTuples(count);
  vtkNew<vtkCellArray> vertices;
  vtkNew<vtkCellArray> lines;
  vertices->AllocateExact(count, count);
  lines->AllocateExact(static_cast<vtkIdType>(tissue.links.size()),
                       static_cast<vtkIdType>(2 * tissue.links.size()));
  for (vtkIdType point = 0; point < count; ++point) {
    const auto n = static_cast<std::size_t>(point);
    const Eigen::Vector3d place = cloud.center_mm + positions_mm[n].cast<double>();
    points->SetPoint(point, place.data());
    const Eigen::Vector3f moved = positions_mm[n] - cloud.positions_mm[n];
    displacement->SetTypedTuple(point, moved.data());
    intensity->SetValue(point, n < cloud.intensities.size() ? cloud.intensities[n] : 0.0F);
    vertices->InsertNextCell({point});
  }
  for (const auto& pair : tissue.links.pairs) lines->InsertNextCell({pair[0], pair[1]});
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetVerts(vertices);
  data->SetLines(lines);
  data->GetPointData()->AddArray(displacement);
  data->GetPointData()->SetScalars(intensity);
  write_file(path, vtp_of(data, path));
}

}  // namespace palpate::surface
