// The march of kernels/lattice_march.cl over a schedule, acted out: cores take the
// heads of the queues in any order, by the rules that the kernel waits by, and what
// a task reads and writes is looked at.
#include "lattice_layout.hpp"

#include "palpate/model/generate.hpp"
#include "palpate/testing/cube_tissue.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <string>
#include <vector>

namespace model = palpate::model;
namespace core = palpate::core;
namespace testing_ = palpate::testing;
using palpate::simulation::build_lattice;
using palpate::simulation::LatticeLayout;
using palpate::simulation::march_schedule_of;
using palpate::simulation::MarchSchedule;

namespace {

constexpr std::uint32_t own_flag = 32;
constexpr std::size_t turn = MarchSchedule::passes_at_once;

/// A box of tissue with holes, of which a link goes far.
model::Tissue tissue_of(const std::array<int, 3>& dims, model::LinkRule rule, double noise, double share) {
  testing_::Numbers numbers(5);
  std::vector<float> values(static_cast<std::size_t>(dims[0] * dims[1] * dims[2]));
  for (float& value : values) value = numbers.between(0.0, 1.0) < share ? 1.0F : 0.0F;
  model::TissueParameters parameters;
  parameters.threshold_low = 0.5;
  parameters.links = rule;
  parameters.noise = noise;
  return model::generate(
      {core::ImageGeometry(dims, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()), std::move(values)},
      parameters);
}

struct Task {
  std::size_t pass = 0;
  std::size_t band = 0;
  std::size_t slab = 0;
};

class Acted {
 public:
  Acted(const model::Tissue& tissue, const LatticeLayout& layout, std::size_t in_slab, std::size_t cores)
      : layout_(layout),
        schedule_(march_schedule_of(layout, in_slab, cores)),
        partners_(layout.segments + 2),
        finished_(layout.segments + 2, 0),
        under_way_(layout.segments + 2, 0),
        done_(schedule_.bands * schedule_.slabs, 0) {
    for (const auto& [a, b] : tissue.links.pairs) {
      const std::uint32_t one = layout.lane_of_point[a] / layout.lanes;
      const std::uint32_t other = layout.lane_of_point[b] / layout.lanes;
      if (one == other) continue;
      partners_[one].insert(other);
      partners_[other].insert(one);
    }
  }

  const MarchSchedule& schedule() const { return schedule_; }

  void expect_each_segment_is_owned_once_in_each_pass() const {
    for (std::size_t nth = 0; nth < turn; ++nth) {
      std::vector<int> owned(layout_.segments + 2, 0);
      for (std::size_t band = 0; band < schedule_.bands; ++band)
        for (std::size_t slab = 0; slab < schedule_.slabs; ++slab)
          for (const std::uint32_t segment : owned_by({nth, band, slab})) ++owned[segment];
      for (std::uint32_t segment = 1; segment <= layout_.segments; ++segment) ASSERT_EQ(owned[segment], 1);
    }
  }

  /// Takes tasks in an order of chance, as many at once as there are cores.
  void run(std::size_t passes, std::size_t cores, unsigned seed) {
    std::mt19937 chance(seed);
    const std::size_t queues = schedule_.turns_at_once;
    std::vector<std::size_t> taken(queues, 0);
    std::vector<Task> running;
    std::size_t left = passes * schedule_.bands * schedule_.slabs;
    while (left > 0) {
      bool took = false;
      if (running.size() < cores) {
        std::vector<std::size_t> order(queues);
        std::iota(order.begin(), order.end(), 0U);
        std::shuffle(order.begin(), order.end(), chance);
        for (const std::size_t queue : order) {
          Task task;
          while (!is_at_end(queue, taken[queue], passes) && !is_one(queue, taken[queue], passes, task))
            ++taken[queue];
          if (is_at_end(queue, taken[queue], passes) || !is_ready(task)) continue;
          ++taken[queue];
          start(task);
          running.push_back(task);
          took = true;
          break;
        }
      }
      ASSERT_TRUE(took || !running.empty()) << "nobody can go on";
      if (!running.empty() && (!took || chance() % 3 == 0)) {
        const std::size_t which = chance() % running.size();
        finish(running[which]);
        running.erase(running.begin() + static_cast<std::ptrdiff_t>(which));
        --left;
      }
    }
    EXPECT_EQ(wrong_, 0U);
  }

 private:
  const std::vector<std::array<std::uint32_t, 2>>& entries() const { return schedule_.entries; }
  std::pair<std::size_t, std::size_t> range(const Task& task) const {
    const std::size_t list = schedule_.bands == 1 ? 0 : task.pass % turn * schedule_.bands + task.band;
    const std::size_t chunk = list * schedule_.slabs + task.slab;
    return {schedule_.chunks.at(chunk), schedule_.chunks.at(chunk + 1)};
  }
  std::vector<std::uint32_t> owned_by(const Task& task) const {
    std::vector<std::uint32_t> segments;
    const auto [begin, end] = range(task);
    for (std::size_t n = begin; n < end; ++n)
      if ((entries()[n][1] & own_flag) != 0) segments.push_back(entries()[n][0]);
    return segments;
  }
  /// Segments that forces are left for.
  std::vector<std::uint32_t> left_for(const Task& task) const {
    std::vector<std::uint32_t> segments;
    const auto [begin, end] = range(task);
    for (std::size_t n = begin; n < end; ++n)
      for (std::size_t row = 0; row < 4; ++row) {
        const std::uint32_t flags = entries()[n][1];
        if ((flags & (2U << row)) != 0 && (flags & (64U << row)) != 0)
          segments.push_back(layout_.rows[entries()[n][0]][row]);
      }
    return segments;
  }

  // The kernel's words.
  std::size_t in_turn() const { return (schedule_.slabs + turn - 1) * turn; }
  bool is_at_end(std::size_t queue, std::size_t task, std::size_t passes) const {
    return task / in_turn() * schedule_.turns_at_once + queue >= (passes + turn - 1) / turn * schedule_.bands;
  }
  bool is_one(std::size_t queue, std::size_t task, std::size_t passes, Task& found) const {
    const std::size_t number = task / in_turn() * schedule_.turns_at_once + queue;
    const std::size_t which = task % turn;
    const std::size_t diagonal = task % in_turn() / turn;
    found = {number / schedule_.bands * turn + which, number % schedule_.bands, diagonal - which};
    return diagonal >= which && found.slab < schedule_.slabs && found.pass < passes;
  }
  std::size_t done(std::size_t band, std::size_t slab) const { return done_[band * schedule_.slabs + slab]; }
  bool is_ready(const Task& task) const {
    const auto& [pass, band, slab] = task;
    const std::size_t above = std::min(slab + 1, schedule_.slabs - 1);
    return done(band, above) >= pass && (slab == 0 || done(band, slab - 1) > pass) &&
           (band == 0 || done(band - 1, above) > pass) &&
           (pass % turn != 0 || band + 1 == schedule_.bands || done(band + 1, above) >= pass);
  }

  void start(const Task& task) {
    const std::size_t pass = task.pass;
    const std::size_t name = name_of(task);
    for (const std::uint32_t segment : left_for(task)) {
      if (finished_[segment] != pass || under_way_[segment] != 0)
        ++wrong_;  // what waits there is of this pass
      const auto [who, is_new] = leaving_.try_emplace(segment, name);
      if (!is_new && who->second != name) ++wrong_;  // two at once
    }
    for (const std::uint32_t segment : owned_by(task)) {
      if (finished_[segment] != pass || under_way_[segment] != 0) ++wrong_;
      const auto who = leaving_.find(segment);
      if (who != leaving_.end() && who->second != name) ++wrong_;  // forces that come too late
      expect_partners_are_there(segment, pass);
    }
    for (const std::uint32_t segment : owned_by(task)) under_way_[segment] = 1;
  }
  void finish(const Task& task) {
    for (const std::uint32_t segment : owned_by(task)) expect_partners_are_there(segment, task.pass);
    for (const std::uint32_t segment : owned_by(task)) {
      under_way_[segment] = 0;
      ++finished_[segment];
    }
    const std::size_t name = name_of(task);
    for (auto each = leaving_.begin(); each != leaving_.end();)
      each = each->second == name ? leaving_.erase(each) : std::next(each);
    ++done_[name];
  }
  std::size_t name_of(const Task& task) const { return task.band * schedule_.slabs + task.slab; }
  /// Two states change places from pass to pass: a partner must have had the pass
  /// before, and must not have begun with the pass after this one.
  void expect_partners_are_there(std::uint32_t segment, std::size_t pass) {
    for (const std::uint32_t partner : partners_[segment])
      if (finished_[partner] < pass || finished_[partner] + under_way_[partner] > pass + 1) ++wrong_;
  }

  const LatticeLayout& layout_;
  MarchSchedule schedule_;
  std::vector<std::set<std::uint32_t>> partners_;
  std::vector<std::size_t> finished_;  ///< passes of each segment
  std::vector<std::size_t> under_way_;
  std::vector<std::size_t> done_;                 ///< passes of each chunk
  std::map<std::uint32_t, std::size_t> leaving_;  ///< segments that forces are being left for, and by whom
  std::size_t wrong_ = 0;
};

void expect_marches(const std::array<int, 3>& dims, model::LinkRule rule, double noise, double share) {
  const model::Tissue tissue = tissue_of(dims, rule, noise, share);
  for (const unsigned lanes : {4U, 16U}) {
    const LatticeLayout layout = build_lattice(tissue, lanes);
    for (const std::size_t cores : {1U, 2U, 5U, 16U})
      for (const unsigned seed : {1U, 2U, 3U}) {
        SCOPED_TRACE(std::to_string(dims[0]) + " x " + std::to_string(dims[1]) + " x " +
                     std::to_string(dims[2]) + ", " + std::to_string(lanes) + " lanes, " +
                     std::to_string(cores) + " cores, seed " + std::to_string(seed));
        Acted acted(tissue, layout, 50, cores);
        EXPECT_LE(acted.schedule().turns_at_once, cores);
        acted.expect_each_segment_is_owned_once_in_each_pass();
        acted.run(7, cores, seed);
        if (::testing::Test::HasFailure()) return;
      }
  }
}

}  // namespace

TEST(LatticeMarch, ReadsNothingThatIsNotThereAndNothingThatIsGone) {
  using model::LinkRule;
  expect_marches({12, 30, 24}, LinkRule::lattice18, 0.0, 1.0);
  expect_marches({20, 60, 5}, LinkRule::lattice26, 0.0, 0.8);
  expect_marches({9, 33, 17}, LinkRule::nearest, 0.3, 0.3);  // links of the overflow reach further than a row
  expect_marches({40, 40, 1}, LinkRule::six, 0.0, 1.0);
}

TEST(LatticeMarch, CutsThinTissueIntoBandsSoThatAllCoresHaveWork) {
  const model::Tissue tissue = tissue_of({20, 80, 4}, model::LinkRule::lattice18, 0.0, 1.0);
  const LatticeLayout layout = build_lattice(tissue, 16);
  const auto alone = march_schedule_of(layout, 50, 1);
  EXPECT_EQ(alone.bands, 1U);
  EXPECT_EQ(alone.turns_at_once, 1U);
  const auto schedule = march_schedule_of(layout, 50, 4);
  EXPECT_GT(schedule.bands, 1U);
  EXPECT_GE(schedule.turns_at_once, 3U);
  EXPECT_EQ(schedule.rows_back, 1);
}
