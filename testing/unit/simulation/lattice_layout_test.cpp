// The lattice layout decoded again by the words of kernels/lattice.cl, link by
// link, against the tissue it was made from.
#include "lattice_layout.hpp"

#include "palpate/imaging/reader.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/testing/cube_tissue.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <set>

namespace model = palpate::model;
namespace core = palpate::core;
namespace testing_ = palpate::testing;
using palpate::simulation::build_lattice;
using palpate::simulation::choose_layout;
using palpate::simulation::LatticeLayout;
using palpate::simulation::LatticeSlots;
using palpate::simulation::schedule_of;

namespace {

using Pair = std::array<std::uint32_t, 2>;

core::Volume box(const std::array<int, 3>& dims, const Eigen::Vector3d& spacing_mm) {
  std::vector<float> values(static_cast<std::size_t>(dims[0] * dims[1] * dims[2]), 1.0F);
  return {core::ImageGeometry(dims, spacing_mm, Eigen::Vector3d::Zero()), std::move(values)};
}

/// A volume of which only some voxels are tissue.
core::Volume sparse_box(int side, double share, std::uint32_t seed) {
  testing_::Numbers numbers(seed);
  std::vector<float> values(static_cast<std::size_t>(side * side * side));
  for (float& value : values) value = numbers.between(0.0, 1.0) < share ? 1.0F : 0.0F;
  return {core::ImageGeometry({side, side, side}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()),
          std::move(values)};
}

model::Tissue tissue_of(const core::Volume& volume, model::LinkRule rule = model::LinkRule::nearest,
                        int stride = 1, double noise = 0.1) {
  model::TissueParameters parameters;
  parameters.threshold_low = 0.5;
  parameters.links = rule;
  parameters.stride = stride;
  parameters.noise = noise;
  return model::generate(volume, parameters);
}

/// What kernels/lattice.cl says of a slot: which row, and the lane of ours that faces their lane l.
struct SlotMeaning {
  int row;
  int our_lane;  ///< less l
};
constexpr std::array<SlotMeaning, LatticeSlots::most> meanings{{{-1, 0},
                                                                {0, 0},
                                                                {0, -1},
                                                                {0, 1},
                                                                {1, 0},
                                                                {1, -1},
                                                                {1, 1},
                                                                {2, 0},
                                                                {3, 0},
                                                                {2, -1},
                                                                {2, 1},
                                                                {3, -1},
                                                                {3, 1}}};

/// Every link that the kernels would evaluate, and its rest length.
class Decoded {
 public:
  explicit Decoded(const LatticeLayout& layout) : layout_(layout) {
    for (std::uint32_t point = 0; point < layout.lane_of_point.size(); ++point)
      point_at_[layout.lane_of_point[point]] = point;
    for (std::uint32_t segment = 1; segment <= layout.segments; ++segment)
      for (unsigned slot = 0; slot < LatticeSlots::most; ++slot)
        if (((layout.slots.used >> slot) & 1U) != 0) decode(segment, slot);
  }
  std::map<Pair, float> links;  ///< by points, the smaller first
  int twice = 0;

 private:
  void decode(std::uint32_t segment, unsigned slot) {
    const std::uint32_t lanes = layout_.lanes;
    for (std::uint32_t lane = 0; lane < lanes; ++lane) {
      const std::size_t index =
          (std::size_t{segment} * layout_.slots.stored() + layout_.slots.rank_of(slot)) * lanes + lane;
      const std::uint16_t n = layout_.rest[index];
      if (n == 0) continue;
      const SlotMeaning meaning = meanings.at(slot);
      const std::uint32_t own = segment * lanes + lane;
      const bool in_row = meaning.row < 0;
      const std::uint32_t a = in_row ? own : own + static_cast<std::uint32_t>(meaning.our_lane);
      const std::uint32_t b =
          in_row ? own + 1 : layout_.rows[segment].at(static_cast<std::size_t>(meaning.row)) * lanes + lane;
      const Pair pair{std::min(point_at_.at(a), point_at_.at(b)), std::max(point_at_.at(a), point_at_.at(b))};
      if (!links.emplace(pair, layout_.rest_quantum_mm * static_cast<float>(n) + layout_.rest_offset_mm)
               .second)
        ++twice;
      const std::uint32_t flag = in_row ? 1U : 2U << static_cast<unsigned>(meaning.row);
      EXPECT_NE(layout_.groups[segment] & flag, 0U) << "the row's flag must be up";
    }
  }

  const LatticeLayout& layout_;
  std::map<std::uint32_t, std::uint32_t> point_at_;
};

void expect_holds_every_link_once(const model::Tissue& tissue, const LatticeLayout& layout) {
  Decoded decoded(layout);
  EXPECT_EQ(decoded.twice, 0);
  std::map<Pair, int> outside;
  std::map<std::uint32_t, std::uint32_t> point_at;
  for (std::uint32_t point = 0; point < layout.lane_of_point.size(); ++point)
    point_at[layout.lane_of_point[point]] = point;
  for (std::uint32_t segment = 1; segment <= layout.segments; ++segment)
    for (std::size_t n = layout.overflow_begins[segment]; n < layout.overflow_begins[segment + 1]; ++n) {
      const auto& link = layout.overflow[n];
      const std::uint32_t own = segment * layout.lanes + (link.apart_z_own >> 16U);
      ++outside[{point_at.at(own), point_at.at(link.partner)}];
      const auto from = layout.site_of(own);
      const auto to = layout.site_of(link.partner);
      EXPECT_EQ(static_cast<std::int16_t>(link.apart_x_y & 0xFFFFU), to[0] - from[0]);
      EXPECT_EQ(static_cast<std::int16_t>(link.apart_x_y >> 16U), to[1] - from[1]);
      EXPECT_EQ(static_cast<std::int16_t>(link.apart_z_own & 0xFFFFU), to[2] - from[2]);
    }
  // A length is rounded to the nearest of 65534 steps between the shortest and the longest.
  const auto [shortest, longest] =
      std::minmax_element(tissue.links.rest_lengths_mm.begin(), tissue.links.rest_lengths_mm.end());
  const float half_step =
      tissue.links.size() == 0 ? 0.0F : (*longest - *shortest) / 65534.0F / 2.0F + 4e-7F * *longest;
  std::size_t wrong = 0;
  for (std::size_t link = 0; link < tissue.links.size(); ++link) {
    const auto& [a, b] = tissue.links.pairs[link];
    const auto found = decoded.links.find({a, b});
    if (found != decoded.links.end()) {
      if (std::abs(found->second - tissue.links.rest_lengths_mm[link]) > half_step) ++wrong;
      if (outside.count({a, b}) != 0) ++wrong;
    } else if (outside[{a, b}] != 1 || outside[{b, a}] != 1) {
      ++wrong;
    }
    const auto place = layout.place_of(layout.lane_of_point[a], layout.lane_of_point[b]);
    if (place.in_stencil != (found != decoded.links.end())) ++wrong;
    if (place.in_stencil && layout.rest.at(place.rest) == 0) ++wrong;
  }
  EXPECT_EQ(wrong, 0U);
  EXPECT_EQ(decoded.links.size() + layout.overflow.size() / 2, tissue.links.size());
  EXPECT_EQ(layout.links_in_overflow, layout.overflow.size() / 2);
}

void expect_each_segment_is_owned_once(const LatticeLayout& layout, std::size_t in_slab, std::size_t chunks) {
  const auto schedule = schedule_of(layout, in_slab, chunks);
  std::vector<int> owned(layout.segments + 2, 0);
  for (const auto& [segment, flags] : schedule.entries)
    if ((flags & 32U) != 0) ++owned[segment];
  for (std::uint32_t segment = 1; segment <= layout.segments; ++segment) ASSERT_EQ(owned[segment], 1);
  for (std::size_t chunk = 0; chunk + 1 < schedule.chunks.size(); ++chunk)
    EXPECT_EQ(schedule.entries.at(schedule.chunks[chunk + 1] - 1)[1], 0U) << "the last entry completes";
  std::uint32_t in_slabs = 0;
  for (const auto& slab : schedule.slabs) in_slabs += slab.chunks;
  EXPECT_EQ(in_slabs + 1, schedule.chunks.size());
}

/// Forces wait in a row from the first that leaves some there, and are read only where there are any.
void expect_one_is_first_to_leave_forces(const LatticeLayout& layout, std::size_t in_slab,
                                         std::size_t chunks) {
  const auto schedule = schedule_of(layout, in_slab, chunks);
  std::vector<int> first(layout.segments + 2, 0);
  std::vector<bool> has_forces(layout.segments + 2, false);
  std::size_t wrong = 0;
  for (const auto& [segment, flags] : schedule.entries)
    for (std::size_t row = 0; row < 4; ++row) {
      const bool writes = (flags & (2U << row)) != 0 && (flags & (64U << row)) != 0;
      const bool is_first = (flags & (2048U << row)) != 0;
      const std::uint32_t target = layout.rows[segment][row];
      if (!writes) continue;
      if (is_first == has_forces[target]) ++wrong;
      has_forces[target] = true;
      if (is_first) ++first[target];
    }
  for (const auto& [segment, flags] : schedule.entries)
    if ((flags & 32U) != 0 && ((flags & 32768U) != 0) != (first[segment] == 1)) ++wrong;
  EXPECT_EQ(wrong, 0U);
}

}  // namespace

TEST(LatticeLayout, HoldsEveryLinkOnceForEveryRuleAndWidth) {
  for (const unsigned lanes : {1U, 4U, 8U, 16U})
    for (const int axes : {1, 2, 3}) {
      model::Tissue tissue = testing_::cube_points(9, 0.0);
      testing_::link_lattice(tissue, axes);
      const LatticeLayout layout = build_lattice(tissue, lanes);
      expect_holds_every_link_once(tissue, layout);
      EXPECT_EQ(layout.slots.stored(), axes == 1 ? 3U : axes == 2 ? 9U : 13U);
      EXPECT_TRUE(choose_layout(tissue).lattice);
    }
}

TEST(LatticeLayout, HoldsMutualNearestOfAJitteredLattice) {
  const model::Tissue tissue = tissue_of(box({37, 20, 18}, Eigen::Vector3d::Ones()));
  const LatticeLayout layout = build_lattice(tissue, 16);
  expect_holds_every_link_once(tissue, layout);
  EXPECT_EQ(layout.slots.stored(), 9U);
  EXPECT_LT(static_cast<double>(layout.links_in_overflow), 0.002 * static_cast<double>(layout.links));
  expect_each_segment_is_owned_once(layout, 1000000, 2);
  expect_one_is_first_to_leave_forces(layout, 1000000, 2);
  expect_each_segment_is_owned_once(layout, 90, 3);
  expect_one_is_first_to_leave_forces(layout, 90, 3);
  expect_each_segment_is_owned_once(layout, 1, 64);
  expect_one_is_first_to_leave_forces(layout, 1, 64);
}

TEST(LatticeLayout, NeverDropsWhatLeavesTheStencil) {
  for (const double slices : {2.0, 3.0}) {
    const model::Tissue tissue = tissue_of(box({20, 19, 18}, {1.0, 1.0, slices}));
    const LatticeLayout layout = build_lattice(tissue, 8);
    expect_holds_every_link_once(tissue, layout);
    EXPECT_GT(layout.links_in_overflow, 0U);
    const auto verdict = choose_layout(tissue);
    EXPECT_FALSE(verdict.lattice) << "too many links are outside: " << verdict.share_outside;
    EXPECT_TRUE(verdict.possible);
    EXPECT_NE(verdict.reason.find("explicit links are faster"), std::string::npos) << verdict.reason;
  }
}

TEST(LatticeLayout, HoldsTheTissueOfAScan) {
  PALPATE_TEST_SCAN(path, "pluslib/SpinePhantomFreehandReconstructed.mha");
  const auto sequence = palpate::imaging::read(path);
  model::TissueParameters parameters;
  parameters.threshold_low = 60.0;
  const auto begin = std::chrono::steady_clock::now();
  const model::Tissue tissue = model::generate(sequence.frames.at(0), parameters);
  const LatticeLayout layout = build_lattice(tissue, 16);
  RecordProperty("build_ms", static_cast<int>(std::chrono::duration_cast<std::chrono::milliseconds>(
                                                  std::chrono::steady_clock::now() - begin)
                                                  .count()));
  expect_holds_every_link_once(tissue, layout);
  expect_each_segment_is_owned_once(layout, 1536, 2);
  expect_one_is_first_to_leave_forces(layout, 1536, 2);
  const auto verdict = choose_layout(tissue);
  EXPECT_TRUE(verdict.lattice) << verdict.reason;
  EXPECT_GT(verdict.share_outside, 0.0);
  EXPECT_LT(verdict.share_outside, 0.01);
  RecordProperty("lanes_per_point", std::to_string(layout.lanes_per_point()));
  RecordProperty("share_outside", std::to_string(verdict.share_outside));
}

TEST(LatticeLayout, HoldsSparseThinAndStridedTissue) {
  for (const unsigned lanes : {4U, 16U}) {
    const model::Tissue sparse = tissue_of(sparse_box(22, 0.3, 5));
    expect_holds_every_link_once(sparse, build_lattice(sparse, lanes));
    const model::Tissue sheet = tissue_of(box({30, 1, 17}, Eigen::Vector3d::Ones()), model::LinkRule::six);
    expect_holds_every_link_once(sheet, build_lattice(sheet, lanes));
    const model::Tissue strided =
        tissue_of(box({33, 21, 20}, Eigen::Vector3d::Ones()), model::LinkRule::nearest, 2);
    const LatticeLayout layout = build_lattice(strided, lanes);
    expect_holds_every_link_once(strided, layout);
    EXPECT_EQ(layout.steps_mm[0].norm(), 2.0);
    expect_each_segment_is_owned_once(build_lattice(sparse, lanes), 20, 2);
    expect_one_is_first_to_leave_forces(build_lattice(sparse, lanes), 20, 2);
  }
}

TEST(LatticeLayout, ALongLinkOutsideTheStencilDoesNotMakeTheOthersCoarse) {
  model::Tissue tissue = tissue_of(box({12, 12, 12}, Eigen::Vector3d::Ones()));
  const float quantum_mm = build_lattice(tissue, 16).rest_quantum_mm;
  EXPECT_LT(quantum_mm, 2e-5F);
  tissue.links.pairs.push_back({0, 1727});
  tissue.links.rest_lengths_mm.push_back(19.0F);
  const LatticeLayout layout = build_lattice(tissue, 16);
  EXPECT_EQ(layout.rest_quantum_mm, quantum_mm);
  expect_holds_every_link_once(tissue, layout);
}

// A fin whose first rows are empty: the first band must not be.
TEST(LatticeLayout, CutsThinTissueWhoseFirstRowsAreEmpty) {
  const core::ImageGeometry grid({16, 8, 75}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  std::vector<float> values;
  for (int k = 0; k < 75; ++k)
    for (int j = 0; j < 8; ++j)
      for (int i = 0; i < 16; ++i) values.push_back(k >= 70 || j == 2 ? 1.0F : 0.0F);
  const model::Tissue tissue = tissue_of(core::Volume(grid, std::move(values)));
  for (const unsigned lanes : {1U, 8U, 16U}) {
    const LatticeLayout layout = build_lattice(tissue, lanes);
    for (const std::size_t in_slab : {20U, 50U, 55U, 1000U})
      for (const std::size_t chunks : {1U, 2U, 7U}) {
        expect_each_segment_is_owned_once(layout, in_slab, chunks);
        expect_one_is_first_to_leave_forces(layout, in_slab, chunks);
      }
  }
}

TEST(LatticeLayout, LaysRowsWhereTheyTakeTheFewestLanes) {
  const LatticeLayout layout = build_lattice(tissue_of(box({17, 8, 32}, Eigen::Vector3d::Ones())), 16);
  EXPECT_EQ(layout.axes[0], 2);
  EXPECT_EQ(layout.lanes_per_point(), 1.0);
}

TEST(LatticeLayout, SitesAreExactInSinglePrecision) {
  const model::Tissue tissue = tissue_of(box({40, 20, 20}, {0.37, 0.41, 0.7}));
  const LatticeLayout layout = build_lattice(tissue, 16);
  for (const std::uint32_t lane : layout.lane_of_point) {
    const Eigen::Vector3d site = layout.site_mm(lane);
    ASSERT_EQ(site.cast<float>().cast<double>(), site);
  }
  // Noise of a tenth of the spacing, and the grid's own share over forty sites.
  for (std::uint32_t point = 0; point < tissue.points.size(); ++point)
    ASSERT_LT((tissue.points.positions_mm[point].cast<double>() - layout.site_mm(layout.lane_of_point[point]))
                  .norm(),
              0.1);
}

TEST(LatticeLayout, RefusesPointsThatShareAVoxelOrLieBesideIt) {
  model::Tissue tissue = testing_::cube_points(3);
  tissue.points.voxels[4] = tissue.points.voxels[5];
  EXPECT_FALSE(choose_layout(tissue).possible);
  EXPECT_THROW(build_lattice(tissue, 8), core::Error);
  model::Tissue strided = testing_::cube_points(3);
  strided.stride = 2;
  EXPECT_FALSE(choose_layout(strided).possible);
  model::Tissue free = testing_::cube_points(3);
  free.on_lattice = false;
  EXPECT_FALSE(choose_layout(free).possible);
}
