#include "palpate/surface/extract.hpp"

#include "shapes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <random>

using palpate::core::Error;
using palpate::core::ImageGeometry;
using palpate::core::TriangleMesh;
using palpate::core::Volume;
using palpate::surface::extract;
using palpate::surface::ExtractParameters;
namespace core = palpate::core;
namespace shapes = palpate::surface::shapes;

namespace {

constexpr double pi = 3.14159265358979323846;

struct Placement {
  const char* name;
  Eigen::Matrix3d direction;
};
std::vector<Placement> placements() {
  return {{"identity", Eigen::Matrix3d::Identity()},
          {"mirror", shapes::mirror()},
          {"oblique", shapes::oblique()},
          {"oblique mirror", shapes::oblique() * shapes::mirror()}};
}

ImageGeometry anisotropic(const Eigen::Matrix3d& direction) {
  return ImageGeometry({60, 48, 30}, {0.5, 0.7, 1.2}, {12.0, -30.0, 45.0}, direction);
}

ExtractParameters at(double iso) {
  ExtractParameters parameters;
  parameters.iso_value = iso;
  return parameters;
}

std::string code_of(const Volume& volume, const ExtractParameters& parameters) {
  try {
    extract(volume, parameters);
  } catch (const Error& error) {
    return error.code();
  }
  return "none";
}

}  // namespace

TEST(Extract, FindsABallWhereItIsUnderEveryDirectionAndSpacing) {
  for (const auto& placement : placements()) {
    SCOPED_TRACE(placement.name);
    const ImageGeometry geometry = anisotropic(placement.direction);
    const Eigen::Vector3d center = geometry.center_mm() + Eigen::Vector3d(0.3, -0.2, 0.4);
    const double radius = 11.0;
    const Volume volume = shapes::volume_of(geometry, shapes::ball(center, radius));
    const TriangleMesh mesh = extract(volume, at(50.0));
    ASSERT_EQ(mesh.normals.size(), mesh.vertices_mm.size());
    ASSERT_EQ(mesh.intensities.size(), mesh.vertices_mm.size());
    EXPECT_TRUE(shapes::closed_and_manifold(mesh));
    double worst = 0.0;
    double least_outwards = 1.0;
    for (std::size_t n = 0; n < mesh.vertices_mm.size(); ++n) {
      const Eigen::Vector3d from_center = mesh.vertices_mm[n].cast<double>() - center;
      worst = std::max(worst, std::abs(from_center.norm() - radius));
      least_outwards = std::min(least_outwards, from_center.normalized().dot(mesh.normals[n].cast<double>()));
      // Just inside the value is higher than on the surface, lower than at the centre.
      EXPECT_GT(mesh.intensities[n], 50.0F);
      EXPECT_LT(mesh.intensities[n], 56.0F);
    }
    // A quarter of the smallest spacing: interpolation along a grid edge is off
    // by h^2/8r = 0.016 mm here, the rest is smoothing.
    EXPECT_LT(worst, 0.125);
    EXPECT_GT(least_outwards, 0.97);  // 14 degrees
    const double exact = 4.0 / 3.0 * pi * radius * radius * radius;
    EXPECT_NEAR(shapes::volume_of(mesh) / exact, 1.0, 0.01);  // also: positive, so wound outwards
  }
}

TEST(Extract, VertexVoxelAndPlaceCoincide) {
  // One bright voxel: its surface lies around the place that the geometry gives it.
  for (const auto& placement : placements()) {
    SCOPED_TRACE(placement.name);
    const ImageGeometry geometry({9, 8, 7}, {0.5, 0.7, 1.2}, {12.0, -30.0, 45.0}, placement.direction);
    std::vector<float> voxels(geometry.voxel_count(), 0.0F);
    voxels[geometry.index(6, 2, 4)] = 100.0F;
    ExtractParameters parameters = at(50.0);
    parameters.smoothing_passes = 0;
    const TriangleMesh mesh = extract(Volume(geometry, voxels), parameters);
    ASSERT_EQ(mesh.vertices_mm.size(), 6U);
    ASSERT_EQ(mesh.triangles.size(), 8U);
    for (const auto& vertex : mesh.vertices_mm) {
      const Eigen::Vector3d ijk = geometry.to_ijk(vertex.cast<double>()) - Eigen::Vector3d(6, 2, 4);
      // Half way along one grid edge; float coordinates of 50 mm round at 4e-6 mm, 8e-6 voxels.
      EXPECT_NEAR(ijk.cwiseAbs().maxCoeff(), 0.5, 2e-5);
      EXPECT_NEAR(ijk.cwiseAbs().sum(), 0.5, 4e-5);
    }
    // An octahedron of semi-axes s/2 has the volume (4/3) product = sx sy sz / 6.
    EXPECT_NEAR(shapes::volume_of(mesh), 0.5 * 0.7 * 1.2 / 6.0, 1e-5);
  }
}

TEST(Extract, KeepsTheShapeOfAnEllipsoidWithinItsBudget) {
  const ImageGeometry geometry({90, 90, 60}, {0.5, 0.5, 0.8}, {0, 0, 0}, shapes::oblique());
  const Eigen::Vector3d center = geometry.center_mm();
  const Eigen::Vector3d axes(18.0, 12.0, 9.0);
  const Volume volume = shapes::volume_of(geometry, [&](const Eigen::Vector3d& place) {
    return 100.0 - 50.0 * (place - center).cwiseQuotient(axes).norm();
  });
  for (const int budget : {50000, 4000, 500}) {
    SCOPED_TRACE(budget);
    ExtractParameters parameters = at(50.0);
    parameters.face_budget = budget;
    const TriangleMesh mesh = extract(volume, parameters);
    EXPECT_LE(mesh.triangles.size(), static_cast<std::size_t>(budget));
    if (budget < 20000) {
      EXPECT_GE(mesh.triangles.size(), static_cast<std::size_t>(budget) - 2);
    }
    EXPECT_TRUE(shapes::closed_and_manifold(mesh));
    double worst = 0.0;
    for (const auto& vertex : mesh.vertices_mm)
      worst = std::max(worst, std::abs((vertex.cast<double>() - center).cwiseQuotient(axes).norm() - 1.0));
    EXPECT_LT(worst * 9.0, 0.25);  // half the smallest spacing, along the shortest axis
    const double exact = 4.0 / 3.0 * pi * axes.prod();
    // Flat faces cut the volume; 500 of them on a ball would take some 1.5 %.
    EXPECT_NEAR(shapes::volume_of(mesh) / exact, 1.0, 0.02);
  }
}

TEST(Extract, ClosesPiecesThatTheBorderCuts) {
  const ImageGeometry geometry({30, 30, 30}, {1.0, 1.0, 1.0}, {0, 0, 0});
  const Volume volume = shapes::volume_of(geometry, shapes::ball(Eigen::Vector3d(0, 14.5, 14.5), 10.0));
  ExtractParameters parameters = at(50.0);
  parameters.smoothing_passes = 0;
  const TriangleMesh mesh = extract(volume, parameters);
  EXPECT_TRUE(shapes::closed_and_manifold(mesh));
  // Half the ball and the half voxel between the border's centres and its cells' ends.
  const double exact = 2.0 / 3.0 * pi * 1000.0 + 0.5 * pi * 100.0;
  EXPECT_NEAR(shapes::volume_of(mesh) / exact, 1.0, 0.02);
  float least = 0.0F;
  for (const auto& vertex : mesh.vertices_mm) least = std::min(least, vertex.x());
  EXPECT_NEAR(least, -0.5F, 1e-3F);
}

TEST(Extract, CropIsClosedToo) {
  const ImageGeometry geometry({30, 30, 30}, {1.0, 1.0, 1.0}, {5, 6, 7}, shapes::mirror());
  const Volume volume = shapes::volume_of(geometry, shapes::ball(geometry.center_mm(), 10.0));
  ExtractParameters parameters = at(50.0);
  parameters.crop = palpate::model::CropBox{{0, 0, 0}, {15, 30, 30}};
  parameters.smoothing_passes = 0;
  const TriangleMesh mesh = extract(volume, parameters);
  EXPECT_TRUE(shapes::closed_and_manifold(mesh));
  EXPECT_NEAR(shapes::volume_of(mesh) / (2.0 / 3.0 * pi * 1000.0), 1.0, 0.02);
}

TEST(Extract, IntegersThatMeetTheValueStayManifold) {
  // Speckle of whole numbers, smoothed by nothing: many voxels are exactly the iso value.
  const ImageGeometry geometry({24, 24, 24}, {1, 1, 1}, {0, 0, 0});
  std::mt19937 random(7);
  std::vector<float> voxels(geometry.voxel_count());
  for (auto& voxel : voxels) voxel = static_cast<float>(random() % 8U);
  ExtractParameters parameters = at(4.0);
  for (const int budget : {1000000, 3000}) {
    parameters.face_budget = budget;
    const TriangleMesh mesh = extract(Volume(geometry, voxels), parameters);
    EXPECT_TRUE(shapes::closed_and_manifold(mesh)) << budget;
    EXPECT_LE(mesh.triangles.size(), static_cast<std::size_t>(budget));
  }
}

TEST(Extract, LeavesOutSpecksAndSmallPieces) {
  const ImageGeometry geometry({60, 40, 40}, {1, 1, 1}, {0, 0, 0});
  const auto large = shapes::ball(Eigen::Vector3d(18, 20, 20), 14.0);
  const auto small = shapes::ball(Eigen::Vector3d(48, 20, 20), 4.0);  // some 270 voxels
  Volume volume =
      shapes::volume_of(geometry, [&](const auto& place) { return std::max(large(place), small(place)); });
  std::vector<float> voxels(volume.data(), volume.data() + volume.size());
  voxels[geometry.index(58, 2, 2)] = 100.0F;
  volume = Volume(geometry, voxels);
  const auto farthest = [](const TriangleMesh& mesh) {
    float most = 0.0F;
    for (const auto& vertex : mesh.vertices_mm) most = std::max(most, vertex.x());
    return most;
  };
  EXPECT_NEAR(farthest(extract(volume, at(50.0))), 52.0F, 0.3F);
  ExtractParameters parameters = at(50.0);
  parameters.min_component = 500;
  EXPECT_NEAR(farthest(extract(volume, parameters)), 32.0F, 0.3F);
  parameters.min_component = 100;
  EXPECT_NEAR(farthest(extract(volume, parameters)), 52.0F, 0.3F);
}

TEST(Extract, RefusesWhatHasNoSurface) {
  const Volume flat(ImageGeometry({20, 20, 1}, {1, 1, 1}, {0, 0, 0}), std::vector<float>(400, 5.0F));
  EXPECT_EQ(code_of(flat, at(1.0)), "no-surface");
  const Volume dark(ImageGeometry({5, 5, 5}, {1, 1, 1}, {0, 0, 0}), std::vector<float>(125, 5.0F));
  EXPECT_EQ(code_of(dark, at(6.0)), "no-surface");
  ExtractParameters outside = at(1.0);
  outside.crop = palpate::model::CropBox{{7, 0, 0}, {9, 5, 5}};
  EXPECT_EQ(code_of(dark, outside), "no-surface");
  EXPECT_EQ(code_of(Volume(), at(1.0)), "no-surface");
  // All of it tissue: the box itself.
  const TriangleMesh box = extract(dark, at(5.0));
  EXPECT_TRUE(shapes::closed_and_manifold(box));
  ExtractParameters wrong = at(1.0);
  wrong.face_budget = 3;
  EXPECT_EQ(code_of(dark, wrong), code_of(dark, at(std::nan(""))));
}

TEST(Extract, StopsWhenCancelledAtEachStage) {
  const ImageGeometry geometry({70, 70, 70}, {1, 1, 1}, {0, 0, 0});
  const Volume volume = shapes::volume_of(geometry, shapes::ball(geometry.center_mm(), 30.0));
  ExtractParameters parameters = at(50.0);
  parameters.face_budget = 1000;
  int stages = 0;
  for (const double from : {0.0, 0.25, 0.6}) {
    core::CancelToken cancel;
    const core::Progress progress(
        [&](double fraction, const std::string&) {
          if (fraction >= from) cancel.cancel();
        },
        cancel);
    try {
      extract(volume, parameters, progress);
      ADD_FAILURE() << "was not stopped from " << from;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), core::ErrorKind::cancelled);
      ++stages;
    }
  }
  EXPECT_EQ(stages, 3);
}

TEST(Extract, AHeartSizedVolumeIsQuick) {
  // A thick shell with ripples and speckle, as large as the thesis' image.
  const ImageGeometry geometry({116, 200, 117}, {0.5, 0.5, 0.5}, {0, 0, 0});
  std::mt19937 random(3);
  std::vector<float> voxels;
  for (int k = 0; k < 117; ++k)
    for (int j = 0; j < 200; ++j)
      for (int i = 0; i < 116; ++i) {
        const double r = Eigen::Vector3d((i - 58) / 50.0, (j - 100) / 90.0, (k - 58) / 50.0).norm();
        const double ripple = 30.0 * std::sin(i * 0.5) * std::sin(j * 0.4) * std::sin(k * 0.6);
        voxels.push_back(static_cast<float>((r < 1.0 && r > 0.7 ? 140.0 : 20.0) + ripple + random() % 40U));
      }
  const auto start = std::chrono::steady_clock::now();
  const TriangleMesh mesh = extract(Volume(geometry, std::move(voxels)), at(90.0));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  RecordProperty("seconds", std::to_string(seconds));
  std::printf("[measured] surface of 116x200x117: %zu faces in %.2f s\n", mesh.triangles.size(), seconds);
  EXPECT_LE(mesh.triangles.size(), 50000U);
  EXPECT_TRUE(shapes::closed_and_manifold(mesh));
  EXPECT_LT(seconds, 20.0);  // about 1 s by itself; the rest is for a busy machine
}

TEST(KeepNear, LeavesOutFacesWithoutTissue) {
  const ImageGeometry geometry({60, 40, 40}, {1, 1, 1}, {3, 4, 5});
  const auto one = shapes::ball(geometry.to_lps_mm({18, 20, 20}), 10.0);
  const auto other = shapes::ball(geometry.to_lps_mm({45, 20, 20}), 8.0);
  const Volume volume =
      shapes::volume_of(geometry, [&](const auto& place) { return std::max(one(place), other(place)); });
  const TriangleMesh both = extract(volume, at(50.0));
  palpate::model::PointCloud points;
  points.center_mm = geometry.center_mm();
  for (std::size_t voxel = 0; voxel < volume.size(); ++voxel) {
    const auto ijk = geometry.ijk_of(voxel);
    if (ijk[0] > 30 || volume.data()[voxel] < 50.0F) continue;
    const Eigen::Vector3d place = geometry.to_lps_mm(Eigen::Vector3d(ijk[0], ijk[1], ijk[2]));
    points.positions_mm.emplace_back((place - points.center_mm).cast<float>());
  }
  const TriangleMesh kept = palpate::surface::keep_near(both, points, 2.0);
  EXPECT_TRUE(shapes::closed_and_manifold(kept));
  EXPECT_NEAR(shapes::volume_of(kept) / (4.0 / 3.0 * pi * 1000.0), 1.0, 0.02);
  EXPECT_EQ(kept.normals.size(), kept.vertices_mm.size());
  EXPECT_EQ(kept.intensities.size(), kept.vertices_mm.size());
  EXPECT_TRUE(palpate::surface::keep_near(both, points, 0.0).empty());
}
