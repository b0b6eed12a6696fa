#include "palpate/imaging/phantom.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/filters.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <itkGDCMImageIO.h>
#include <itkGDCMSeriesFileNames.h>
#include <itkImage.h>
#include <itkImageFileReader.h>
#include <itkImageSeriesReader.h>
#include <itkMetaImageIO.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace {

using palpate::core::CancelToken;
using palpate::core::Error;
using palpate::core::ErrorKind;
using palpate::core::Progress;
using palpate::core::TriangleMesh;
using palpate::core::Volume;
using palpate::imaging::apply_filters;
using palpate::imaging::make_phantom;
using palpate::imaging::Phantom;
using palpate::imaging::PhantomLabel;
using palpate::imaging::PhantomParameters;

Phantom made(int size, int frames = 1, std::uint64_t seed = 1) {
  PhantomParameters parameters;
  parameters.size = size;
  parameters.frames = frames;
  parameters.seed = seed;
  return make_phantom(parameters);
}

/// Of the size of the shipped sample; made once for the tests that look at it.
const Phantom& sample() {
  static const Phantom phantom = made(96);
  return phantom;
}

bool is(const Volume& labels, std::size_t n, PhantomLabel label) {
  return labels.data()[n] == static_cast<float>(label);
}

double voxel_ml(const Volume& volume) { return volume.geometry().spacing_mm().prod() / 1000.0; }

std::size_t count(const Volume& labels, PhantomLabel label) {
  std::size_t found = 0;
  for (std::size_t n = 0; n < labels.size(); ++n) found += is(labels, n, label) ? 1U : 0U;
  return found;
}

double mean_of(const Phantom& phantom, PhantomLabel label) {
  double sum = 0.0;
  for (std::size_t n = 0; n < phantom.labels.size(); ++n)
    if (is(phantom.labels, n, label)) sum += phantom.frames[0].data()[n];
  return sum / static_cast<double>(count(phantom.labels, label));
}

/// FNV-1a over voxels, each a whole number of 8 bits.
std::uint64_t checksum(const Volume& volume) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (std::size_t n = 0; n < volume.size(); ++n)
    hash = (hash ^ static_cast<std::uint64_t>(volume.data()[n])) * 0x100000001B3ULL;
  return hash;
}

TEST(Phantom, HasTheSameVoxelsEverywhere) {
  // Recorded when the phantom was made; another machine, compiler or number
  // of threads must come to the same. The samples in data/ depend on it.
  const Phantom phantom = made(32, 2);
  EXPECT_EQ(checksum(phantom.frames[0]), 0x0DC00B22EE0C003AULL);
  EXPECT_EQ(checksum(phantom.frames[1]), 0x8CA5427A924302A8ULL);
  EXPECT_EQ(checksum(phantom.labels), 0x77306899E9A62833ULL);
  EXPECT_EQ(checksum(made(32).frames[0]), checksum(phantom.frames[0]))
      << "the first frame is the still heart";
  EXPECT_NE(checksum(made(32, 1, 2).frames[0]), checksum(phantom.frames[0]))
      << "another seed, another speckle";
  EXPECT_EQ(checksum(made(32, 1, 2).labels), checksum(phantom.labels)) << "and the same heart";
}

TEST(Phantom, IsAsLongAsAskedAndCentredInPlainLps) {
  for (const int size : {16, 33, 96}) {
    const Phantom phantom = made(size);
    const auto& geometry = phantom.labels.geometry();
    EXPECT_EQ(*std::max_element(geometry.dims().begin(), geometry.dims().end()), size);
    EXPECT_EQ(geometry.direction(), Eigen::Matrix3d::Identity());
    EXPECT_LT(geometry.center_mm().norm(), 1e-9);
    EXPECT_EQ(phantom.frames[0].geometry(), geometry);
    for (std::size_t n = 0; n < phantom.labels.size(); ++n) {
      const float value = phantom.frames[0].data()[n];
      ASSERT_TRUE(value >= 0.0F && value <= 255.0F && value == std::floor(value));
    }
  }
}

TEST(Phantom, GreyIsAsTheCommandLinePromises) {
  // "Around" is within 10 of 140 and of 20, over the whole label: shadow, the
  // black outside of the probe's view and partial volume included.
  for (const int size : {64, 96, 128}) {
    SCOPED_TRACE(size);
    const Phantom phantom = size == 96 ? sample() : made(size);
    EXPECT_NEAR(mean_of(phantom, PhantomLabel::wall), 140.0, 10.0);
    EXPECT_NEAR(mean_of(phantom, PhantomLabel::cavity), 20.0, 10.0);
    EXPECT_NEAR(mean_of(phantom, PhantomLabel::background), 20.0, 10.0);
    EXPECT_GT(mean_of(phantom, PhantomLabel::valve), 60.0);
    EXPECT_GT(count(phantom.labels, PhantomLabel::valve), 100U);
  }
}

TEST(Phantom, HasTheMeasuresOfAnAdultsLeftVentricle) {
  const Volume& labels = sample().labels;
  const double spacing = labels.geometry().spacing_mm().x();
  std::array<int, 3> low = labels.dims();
  std::array<int, 3> high{};
  for (std::size_t n = 0; n < labels.size(); ++n) {
    if (!is(labels, n, PhantomLabel::wall)) continue;
    const auto ijk = labels.geometry().ijk_of(n);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], ijk[axis]);
      high[axis] = std::max(high[axis], ijk[axis]);
    }
  }
  const auto extent = [&](std::size_t axis) { return (high[axis] - low[axis] + 1) * spacing; };
  // Some 92 mm long and 66 mm wide, each to a voxel on either side.
  EXPECT_NEAR(extent(1), 92.0, 2.0 * spacing);
  EXPECT_NEAR(extent(0), 66.0, 2.0 * spacing);
  EXPECT_NEAR(extent(2), 66.0, 2.0 * spacing);
  // Muscle weighs 1.05 g/ml; men have 88 to 224 g, women 67 to 162 g, and at
  // most 150 ml or 106 ml in the cavity (echocardiographic reference values).
  EXPECT_GT(count(labels, PhantomLabel::wall) * voxel_ml(labels) * 1.05, 88.0);
  EXPECT_LT(count(labels, PhantomLabel::wall) * voxel_ml(labels) * 1.05, 162.0);
  EXPECT_GT(count(labels, PhantomLabel::cavity) * voxel_ml(labels), 62.0);
  EXPECT_LT(count(labels, PhantomLabel::cavity) * voxel_ml(labels), 106.0);
  // The wall is 6 to 10 mm thick: counted along x through the middle, to a voxel.
  int wall = 0;
  const auto centre = labels.geometry().to_ijk({0.0, 22.0, 0.0});
  for (int i = 0; i < labels.dims()[0] / 2; ++i)
    wall += is(labels, labels.geometry().index(i, static_cast<int>(centre.y()), static_cast<int>(centre.z())),
               PhantomLabel::wall)
                ? 1
                : 0;
  EXPECT_NEAR(wall * spacing, 9.5, spacing);
}

/// Otsu's threshold over 256 bins of whole numbers.
double otsu(const Volume& volume) {
  std::array<double, 256> bins{};
  for (std::size_t n = 0; n < volume.size(); ++n) bins.at(static_cast<std::size_t>(volume.data()[n])) += 1.0;
  double total = 0.0;
  for (int v = 0; v < 256; ++v) total += v * bins.at(static_cast<std::size_t>(v));
  double below = 0.0;
  double sum = 0.0;
  double best = -1.0;
  double threshold = 0.0;
  const auto all = static_cast<double>(volume.size());
  for (int v = 0; v < 255; ++v) {
    below += bins.at(static_cast<std::size_t>(v));
    sum += v * bins.at(static_cast<std::size_t>(v));
    if (below == 0.0 || below == all) continue;
    const double apart = sum / below - (total - sum) / (all - below);
    const double between = below * (all - below) * apart * apart;
    if (between > best) {
      best = between;
      threshold = v + 0.5;
    }
  }
  return threshold;
}

/// The voxels of the largest six-connected component over the threshold, and how many are over it.
std::pair<std::vector<std::size_t>, std::size_t> largest_component(const Volume& volume, double threshold) {
  std::vector<char> open(volume.size());
  std::size_t over = 0;
  for (std::size_t n = 0; n < volume.size(); ++n) over += open[n] = volume.data()[n] > threshold ? 1 : 0;
  std::vector<std::size_t> largest;
  for (std::size_t start = 0; start < open.size(); ++start) {
    if (open[start] == 0) continue;
    std::vector<std::size_t> found{start};
    open[start] = 0;
    for (std::size_t next = 0; next < found.size(); ++next) {
      const auto at = volume.geometry().ijk_of(found[next]);
      for (std::size_t axis = 0; axis < 3; ++axis)
        for (const int step : {-1, 1}) {
          auto to = at;
          to[axis] += step;
          if (!volume.geometry().contains(to[0], to[1], to[2])) continue;
          const auto n = volume.geometry().index(to[0], to[1], to[2]);
          if (open[n] == 0) continue;
          open[n] = 0;
          found.push_back(n);
        }
    }
    if (found.size() > largest.size()) largest = std::move(found);
  }
  return {largest, over};
}

void expect_wall_separates(const Volume& volume, double whole_wall) {
  const double threshold = otsu(volume);
  EXPECT_GT(threshold, 50.0);
  EXPECT_LT(threshold, 110.0);
  const auto [component, over] = largest_component(volume, threshold);
  EXPECT_GT(static_cast<double>(component.size()), 0.97 * static_cast<double>(over))
      << "not one dominant component";
  std::size_t wall = 0;
  std::size_t elsewhere = 0;
  for (const std::size_t n : component) {
    wall += is(sample().labels, n, PhantomLabel::wall) ? 1U : 0U;
    const bool far =
        is(sample().labels, n, PhantomLabel::cavity) || is(sample().labels, n, PhantomLabel::background);
    elsewhere += far ? 1U : 0U;
  }
  EXPECT_GT(static_cast<double>(wall),
            whole_wall * static_cast<double>(count(sample().labels, PhantomLabel::wall)));
  // What is not wall or valve is the half of an edge's voxels that leans to them.
  EXPECT_LT(static_cast<double>(elsewhere), 0.08 * static_cast<double>(component.size()));
}

TEST(Phantom, OtsusThresholdTakesTheWallInOnePiece) {
  // Unfiltered, speckle leaves dark holes in the wall; a median closes them.
  expect_wall_separates(sample().frames[0], 0.82);
  expect_wall_separates(apply_filters(sample().frames[0], {{"median", {}}}).volume, 0.93);
}

TEST(Phantom, SpeckleScalesWithTheSignalAndIsFinerAlongTheBeam) {
  const Volume& volume = sample().frames[0];
  const auto spread = [&](PhantomLabel label) {
    double squares = 0.0;
    const double mean = mean_of(sample(), label);
    for (std::size_t n = 0; n < volume.size(); ++n)
      if (is(sample().labels, n, label)) squares += std::pow(volume.data()[n] - mean, 2);
    return std::sqrt(squares / static_cast<double>(count(sample().labels, label))) / mean;
  };
  // The root of a Rayleigh variable varies by 0.28 of its mean; gain, shadow and edges add.
  EXPECT_GT(spread(PhantomLabel::wall), 0.25);
  EXPECT_LT(spread(PhantomLabel::wall), 0.45);
  // Neighbours in the deep septum, where y is nearly along the beam and z across it.
  const auto correlation = [&](int dj, int dk) {
    double xy = 0.0, x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, n = 0.0;
    for (int k = 25; k < 45; ++k)
      for (int j = 55; j < 80; ++j)
        for (int i = 0; i < volume.dims()[0] / 2; ++i) {
          const auto& g = volume.geometry();
          if (!is(sample().labels, g.index(i, j, k), PhantomLabel::wall)) continue;
          if (!is(sample().labels, g.index(i, j + dj, k + dk), PhantomLabel::wall)) continue;
          const double a = volume.at(i, j, k);
          const double b = volume.at(i, j + dj, k + dk);
          x += a, y += b, xy += a * b, xx += a * a, yy += b * b, n += 1.0;
        }
    return (xy / n - x / n * y / n) / std::sqrt((xx / n - x * x / n / n) * (yy / n - y * y / n / n));
  };
  EXPECT_GT(correlation(0, 1), correlation(1, 0) + 0.1);
  EXPECT_GT(correlation(1, 0), 0.1);
  EXPECT_LT(std::abs(correlation(10, 0)), 0.15);
}

TEST(Phantom, ARibsShadowLiesOnTheLateralSide) {
  const Volume& volume = sample().frames[0];
  // The probe is 15 mm before the apex: y = -61 mm here. Across the beam the
  // shadow is at tangent 0.30 (and 0.30 of the elevation's), to the left.
  double shadow = 0.0, mirror = 0.0, n = 0.0;
  for (std::size_t v = 0; v < volume.size(); ++v) {
    const auto [i, j, k] = volume.geometry().ijk_of(v);
    const Eigen::Vector3d place =
        volume.geometry().to_lps_mm(Eigen::Vector3d(i, j, k)) + Eigen::Vector3d(0, 61, 0);
    const double across = place.x() / place.y() - 0.30 * place.z() / place.y();
    const auto opposite = volume.geometry().index(volume.dims()[0] - 1 - i, j, k);
    if (!is(sample().labels, v, PhantomLabel::wall) || !is(sample().labels, opposite, PhantomLabel::wall))
      continue;
    if (std::abs(across - 0.30) > 0.02) continue;
    shadow += volume.data()[v];
    mirror += volume.data()[opposite];
    n += 1.0;
  }
  ASSERT_GT(n, 100.0);
  // It takes 45 % away; a part of the other side lies in it too.
  EXPECT_GT(shadow / mirror, 0.45);
  EXPECT_LT(shadow / mirror, 0.75);
}

struct Measured {
  double cavity_ml = 0.0;
  double thickness_mm = 0.0;
};

/// As it is done by hand: discs along the axis, their borders found on rays
/// from the axis to the first bright voxel; thickness in the middle third.
Measured measured(const Volume& frame) {
  const Volume smooth = apply_filters(frame, {{"median", {}}}).volume;
  const auto& geometry = smooth.geometry();
  constexpr int rays = 48;
  constexpr double step_mm = 0.25;
  Measured result;
  std::vector<double> thicknesses;
  for (int j = 0; j < smooth.dims()[1]; ++j) {
    double area = 0.0;
    double thickness = 0.0;
    int hits = 0;
    for (int ray = 0; ray < rays; ++ray) {
      const double angle = 2.0 * 3.14159265358979 * ray / rays;
      const auto bright = [&](double r) {
        Eigen::Vector3d ijk = geometry.to_ijk({r * std::cos(angle), 0.0, r * std::sin(angle)});
        ijk.y() = j;
        return smooth.sample(ijk) > 75.0F;
      };
      double inner = 0.0;
      while (inner < 36.0 && !bright(inner)) inner += step_mm;
      double outer = inner;
      while (outer < 44.0 && bright(outer)) outer += step_mm;
      if (inner >= 36.0) continue;
      ++hits;
      area += 3.14159265358979 * inner * inner / rays;
      thickness += (outer - inner) / rays;
    }
    if (hits < rays * 4 / 5) continue;
    result.cavity_ml += area * geometry.spacing_mm().y() / 1000.0;
    const double y = geometry.to_lps_mm(Eigen::Vector3d(0, j, 0)).y();
    if (y > -5.0 && y < 20.0) thicknesses.push_back(thickness);
  }
  for (const double t : thicknesses) result.thickness_mm += t / static_cast<double>(thicknesses.size());
  return result;
}

TEST(Phantom, BeatsWithANormalEjectionFractionAndThickens) {
  const Phantom phantom = made(64, 10);
  ASSERT_EQ(phantom.frames.size(), 10U);
  std::vector<Measured> beat;
  for (const auto& frame : phantom.frames) beat.push_back(measured(frame));
  const auto by_volume = [](const Measured& a, const Measured& b) { return a.cavity_ml < b.cavity_ml; };
  const auto systole = *std::min_element(beat.begin(), beat.end(), by_volume);
  const double ejection = 1.0 - systole.cavity_ml / beat[0].cavity_ml;
  RecordProperty("ejection_percent", static_cast<int>(100.0 * ejection));
  EXPECT_EQ(std::max_element(beat.begin(), beat.end(), by_volume)->cavity_ml, beat[0].cavity_ml)
      << "the first frame is end diastole";
  // Made to be 58 %; the discs see papillary muscles and leaflets their own way.
  EXPECT_GT(ejection, 0.50);
  EXPECT_LT(ejection, 0.68);
  EXPECT_GT(systole.thickness_mm, 1.25 * beat[0].thickness_mm);
  EXPECT_LT(systole.thickness_mm, 1.8 * beat[0].thickness_mm);
}

double enclosed_ml(const TriangleMesh& mesh) {
  double six_volumes = 0.0;
  for (const auto& [a, b, c] : mesh.triangles)
    six_volumes += mesh.vertices_mm[a].cast<double>().dot(
        mesh.vertices_mm[b].cast<double>().cross(mesh.vertices_mm[c].cast<double>()));
  return six_volumes / 6000.0;
}

TEST(Phantom, ItsSurfaceIsTheWallsBorderClosedAndWoundOutwards) {
  const TriangleMesh& surface = sample().surface;
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : surface.triangles)
    for (std::size_t n = 0; n < 3; ++n) ++edges[{t[n], t[(n + 1) % 3]}];
  for (const auto& [edge, times] : edges) {
    ASSERT_EQ(times, 1);
    ASSERT_EQ(edges.count({edge.second, edge.first}), 1U) << "a hole";
  }
  // One bowl: vertices - edges + faces = 2.
  EXPECT_EQ(static_cast<long>(surface.vertices_mm.size()) - static_cast<long>(edges.size() / 2) +
                static_cast<long>(surface.triangles.size()),
            2);
  const Volume& labels = sample().labels;
  const double wall_ml = static_cast<double>(count(labels, PhantomLabel::wall)) * voxel_ml(labels);
  // Positive only when wound outwards. Flat triangles cut 0.1 % of a ring of
  // 96 corners off; counting voxels errs by less than 1 %.
  EXPECT_NEAR(enclosed_ml(surface), wall_ml, 0.015 * wall_ml);
  ASSERT_EQ(surface.normals.size(), surface.vertices_mm.size());

  // Each vertex has wall and something else within a voxel of it.
  const auto& geometry = labels.geometry();
  for (const auto& vertex : surface.vertices_mm) {
    const Eigen::Vector3d ijk = geometry.to_ijk(vertex.cast<double>());
    bool wall = false;
    bool other = false;
    for (int k = static_cast<int>(std::ceil(ijk.z() - 1)); k <= static_cast<int>(std::floor(ijk.z() + 1));
         ++k)
      for (int j = static_cast<int>(std::ceil(ijk.y() - 1)); j <= static_cast<int>(std::floor(ijk.y() + 1));
           ++j)
        for (int i = static_cast<int>(std::ceil(ijk.x() - 1)); i <= static_cast<int>(std::floor(ijk.x() + 1));
             ++i)
          (is(labels, geometry.index(i, j, k), PhantomLabel::wall) ? wall : other) = true;
    ASSERT_TRUE(wall && other) << vertex.transpose();
  }
}

TEST(Phantom, RefusesWhatItCannotMake) {
  const auto kind_of = [](int size, int frames, double period) {
    PhantomParameters parameters;
    parameters.size = size;
    parameters.frames = frames;
    parameters.period_s = period;
    try {
      make_phantom(parameters);
    } catch (const Error& error) {
      return std::optional<ErrorKind>(error.kind());
    }
    return std::optional<ErrorKind>();
  };
  EXPECT_EQ(kind_of(15, 1, 0.8), ErrorKind::usage);
  EXPECT_EQ(kind_of(513, 1, 0.8), ErrorKind::usage);
  EXPECT_EQ(kind_of(32, 0, 0.8), ErrorKind::usage);
  EXPECT_EQ(kind_of(32, 65, 0.8), ErrorKind::usage);
  EXPECT_EQ(kind_of(32, 1, 0.0), ErrorKind::usage);
  EXPECT_EQ(kind_of(32, 1, std::nan("")), ErrorKind::usage);
  EXPECT_EQ(kind_of(512, 64, 0.8), ErrorKind::usage) << "more memory than a machine has";
}

TEST(Phantom, ReportsProgressAndStops) {
  std::vector<double> fractions;
  const CancelToken cancel;
  PhantomParameters parameters;
  parameters.size = 32;
  parameters.frames = 3;
  make_phantom(parameters, Progress([&](double f, const std::string&) { fractions.push_back(f); }, cancel));
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_DOUBLE_EQ(fractions.back(), 1.0);
  const auto stop = [&](double f, const std::string&) {
    if (f > 0.4) cancel.cancel();
  };
  try {
    make_phantom(parameters, Progress(stop, cancel));
    FAIL() << "ran to its end";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::cancelled);
  }
}

template <typename Image>
typename Image::Pointer read_meta(const std::string& path) {
  const auto reader = itk::ImageFileReader<Image>::New();
  reader->SetImageIO(itk::MetaImageIO::New());
  reader->SetFileName(path);
  reader->Update();
  return reader->GetOutput();
}

void expect_place(const itk::ImageBase<3>& image, const Volume& volume) {
  for (unsigned axis = 0; axis < 3; ++axis) {
    ASSERT_EQ(image.GetLargestPossibleRegion().GetSize(axis), static_cast<std::size_t>(volume.dims()[axis]));
    EXPECT_DOUBLE_EQ(image.GetSpacing()[axis], volume.geometry().spacing_mm()[axis]);
    EXPECT_DOUBLE_EQ(image.GetOrigin()[axis], volume.geometry().origin_mm()[axis]);
  }
}

const std::string samples = PALPATE_SAMPLES;

TEST(ShippedSample, IsThePhantomOfItsReadme) {
  using Image = itk::Image<float, 3>;
  const Volume& expected = sample().frames[0];
  const auto meta = read_meta<Image>(samples + "/sample-heart.mha");
  expect_place(*meta, expected);
  EXPECT_TRUE(std::equal(expected.data(), expected.data() + expected.size(), meta->GetBufferPointer()));

  const auto names = itk::GDCMSeriesFileNames::New();
  names->SetDirectory(samples + "/sample-heart-dicom");
  const auto reader = itk::ImageSeriesReader<Image>::New();
  reader->SetImageIO(itk::GDCMImageIO::New());
  reader->SetFileNames(names->GetInputFileNames());
  reader->Update();
  expect_place(*reader->GetOutput(), expected);
  EXPECT_TRUE(std::equal(expected.data(), expected.data() + expected.size(),
                         reader->GetOutput()->GetBufferPointer()));
}

TEST(ShippedSample, TheBeatingOneToo) {
  const Phantom phantom = made(64, 8);
  const auto image = read_meta<itk::Image<float, 4>>(samples + "/sample-heart-beat.mha");
  ASSERT_EQ(image->GetLargestPossibleRegion().GetSize(3), 8U);
  EXPECT_DOUBLE_EQ(image->GetSpacing()[3], 0.1);
  const float* voxels = image->GetBufferPointer();
  for (const auto& frame : phantom.frames) {
    EXPECT_TRUE(std::equal(frame.data(), frame.data() + frame.size(), voxels));
    voxels += frame.size();
  }
}

}  // namespace
