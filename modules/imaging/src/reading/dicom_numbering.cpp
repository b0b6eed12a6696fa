// Which frame is which slice of which time.
#include "dicom_assembly.hpp"
#include "parsed.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;
using Place = std::vector<std::size_t>;  ///< indices of the records that lie there

/// Frames sorted into places along the normal.
std::vector<Place> places_of(const std::vector<FrameRecord>& records, std::vector<double>& along_mm) {
  const Eigen::Vector3d normal = records.front().plane->normal();
  std::vector<std::size_t> order(records.size());
  for (std::size_t n = 0; n < order.size(); ++n) order[n] = n;
  const auto along = [&](std::size_t n) { return records[n].plane->position.dot(normal); };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return along(a) < along(b); });
  // Positions carry rounding, and those of one place differ a little from time
  // to time; slices of microscopes are microns apart. What is closer than a
  // twentieth of the widest step, and than any slice is thick, is one place.
  double widest = 0.0;
  for (std::size_t n = 1; n < order.size(); ++n)
    widest = std::max(widest, along(order[n]) - along(order[n - 1]));
  const double tolerance = std::min(0.02, 0.05 * widest);
  std::vector<Place> places;
  for (const std::size_t n : order) {
    if (places.empty() || along(n) - along(places.back().front()) > tolerance) {
      places.emplace_back();
      along_mm.push_back(along(n));
    }
    places.back().push_back(n);
  }
  return places;
}

/// Something that may tell frames of one place apart.
struct Key {
  std::string name;
  std::vector<double> values;  ///< one a record
  bool time = true;            ///< else an echo, a b-value, ...
};

std::vector<Key> keys_of(const std::vector<FrameRecord>& records) {
  std::vector<Key> keys;
  const auto add = [&](const std::string& name, bool time, const auto& value_of) {
    Key key{name, {}, time};
    for (const auto& record : records) {
      const std::optional<double> value = value_of(record);
      if (!value) return;
      key.values.push_back(*value);
    }
    keys.push_back(std::move(key));
  };
  add("temporal position", true, [](const FrameRecord& r) { return r.clock.temporal_index; });
  add("time", true, [](const FrameRecord& r) { return r.clock.offset_s; });
  add("trigger time", true, [](const FrameRecord& r) { return r.clock.trigger_s; });
  std::set<std::string> names;
  for (const auto& record : records)
    for (const auto& [name, value] : record.clock.contrasts) names.insert(name);
  for (const auto& name : names)
    add(name, false, [&](const FrameRecord& r) -> std::optional<double> {
      const auto found = r.clock.contrasts.find(name);
      return found == r.clock.contrasts.end() ? std::nullopt : std::optional<double>(found->second);
    });
  std::vector<std::string> types;
  for (const auto& record : records) types.push_back(record.clock.image_type);
  std::sort(types.begin(), types.end());
  types.erase(std::unique(types.begin(), types.end()), types.end());
  if (types.size() > 1)
    add("image type", false, [&](const FrameRecord& r) -> std::optional<double> {
      return static_cast<double>(std::lower_bound(types.begin(), types.end(), r.clock.image_type) -
                                 types.begin());
    });
  add("acquisition number", true, [](const FrameRecord& r) { return r.clock.acquisition; });
  add("acquisition time", true, [](const FrameRecord& r) { return r.clock.acquired_s; });
  add("content time", true, [](const FrameRecord& r) { return r.clock.content_s; });
  return keys;
}

using Values = std::vector<double>;

/// The keys that together give every frame of a place another value, as few
/// of them as needed in their order; the last resort are the instance numbers.
struct Discriminator {
  std::vector<const Key*> keys;
  bool by_instance = false;

  Values of(const std::vector<FrameRecord>& records, std::size_t n) const {
    Values values;
    for (const Key* key : keys) values.push_back(key->values[n]);
    if (by_instance) {
      values.push_back(records[n].clock.instance.value_or(0.0));
      values.push_back(records[n].file_frame);
    }
    return values;
  }
};

Discriminator tell_apart(const std::vector<Place>& places, const std::vector<Key>& keys) {
  Discriminator found;
  const auto count_distinct = [&](const std::vector<const Key*>& used) {
    std::size_t count = 0;
    for (const auto& place : places) {
      std::set<Values> seen;
      for (const std::size_t n : place) {
        Values values;
        for (const Key* key : used) values.push_back(key->values[n]);
        seen.insert(values);
      }
      count += seen.size();
    }
    return count;
  };
  std::size_t left = 0;
  for (const auto& place : places) left += place.size();
  std::size_t best = places.size();
  for (const auto& key : keys) {
    if (best == left) break;
    auto with = found.keys;
    with.push_back(&key);
    const std::size_t count = count_distinct(with);
    if (count <= best) continue;
    best = count;
    found.keys = with;
  }
  found.by_instance = best != left;
  return found;
}

/// Instance numbers that run time by time or place by place; anything else is no order.
bool instances_run_in_blocks(const std::vector<FrameRecord>& records,
                             const std::vector<std::vector<std::size_t>>& at) {
  const auto number = [&](std::size_t n) {
    return records[n].clock.instance.value_or(0.0) * 1e6 + records[n].file_frame;
  };
  const auto apart = [&](const std::vector<std::vector<std::size_t>>& groups) {
    std::vector<std::pair<double, double>> ranges;
    for (const auto& group : groups) {
      double low = std::numeric_limits<double>::infinity();
      double high = -low;
      for (const std::size_t n : group) {
        low = std::min(low, number(n));
        high = std::max(high, number(n));
      }
      ranges.emplace_back(low, high);
    }
    std::sort(ranges.begin(), ranges.end());
    for (std::size_t n = 1; n < ranges.size(); ++n)
      if (ranges[n].first <= ranges[n - 1].second) return false;
    return true;
  };
  std::vector<std::vector<std::size_t>> by_place(at.front().size());
  for (const auto& frame : at)
    for (std::size_t k = 0; k < frame.size(); ++k) by_place[k].push_back(frame[k]);
  return apart(at) || apart(by_place);
}

std::size_t fewest(const std::vector<Place>& places) {
  std::size_t count = std::numeric_limits<std::size_t>::max();
  for (const auto& place : places) count = std::min(count, place.size());
  return count;
}
std::size_t most(const std::vector<Place>& places) {
  std::size_t count = 0;
  for (const auto& place : places) count = std::max(count, place.size());
  return count;
}

/// Drops frames whose pixels are those of another frame of the same place.
/// Where all places hold equally many, only if that is so at the first of
/// them. Returns how many.
std::size_t drop_copies(const std::vector<FrameRecord>& records, const SamePixels& same_pixels,
                        std::vector<Place>& places) {
  std::size_t dropped = 0;
  const bool even = fewest(places) == most(places);
  for (auto& place : places) {
    Place kept;
    for (const std::size_t n : place)
      if (std::none_of(kept.begin(), kept.end(),
                       [&](std::size_t other) { return same_pixels(records[n], records[other]); }))
        kept.push_back(n);
    dropped += place.size() - kept.size();
    place = kept;
    if (even && dropped == 0) break;
  }
  return dropped;
}

/// Frames from keys whose values recur at every place; empty where they do not.
std::vector<std::vector<std::size_t>> tabulate(const std::vector<FrameRecord>& records,
                                               const std::vector<Place>& places, const Discriminator& keys,
                                               std::size_t& incomplete) {
  std::map<Values, std::map<std::size_t, std::size_t>> table;  // key -> place -> record
  for (std::size_t k = 0; k < places.size(); ++k)
    for (const std::size_t n : places[k]) table[keys.of(records, n)][k] = n;
  std::vector<std::vector<std::size_t>> at;
  incomplete = 0;
  for (const auto& [values, by_place] : table) {
    if (by_place.size() != places.size()) {
      ++incomplete;
      continue;
    }
    at.emplace_back();
    for (const auto& [k, n] : by_place) at.back().push_back(n);
  }
  return at;
}

std::vector<std::vector<std::size_t>> rank(const std::vector<FrameRecord>& records,
                                           const std::vector<Place>& places, const Discriminator& keys) {
  std::vector<std::vector<std::size_t>> at(places.front().size());
  for (const auto& place : places) {
    Place sorted = place;
    std::stable_sort(sorted.begin(), sorted.end(),
                     [&](std::size_t a, std::size_t b) { return keys.of(records, a) < keys.of(records, b); });
    for (std::size_t frame = 0; frame < at.size(); ++frame) at[frame].push_back(sorted[frame]);
  }
  return at;
}

/// The frames' times by one of the clocks: its smallest value of each frame,
/// where that rises from frame to frame.
template <typename Clock>
bool take_times(const std::vector<FrameRecord>& records, const std::vector<std::vector<std::size_t>>& at,
                const Clock& clock, Provenance provenance, core::VolumeInfo& info) {
  std::vector<double> times;
  for (const auto& frame : at) {
    double first = std::numeric_limits<double>::infinity();
    for (const std::size_t n : frame) {
      const std::optional<double> time = clock(records[n].clock);
      if (!time) return false;
      first = std::min(first, *time);
    }
    if (!times.empty() && !(first > times.back())) return false;
    times.push_back(first);
  }
  const double start = times.front();
  for (double& time : times) time -= start;
  info.frame_times_s = times;
  info.time_provenance = provenance;
  return true;
}

void say_times(const std::vector<FrameRecord>& records, const Numbered& numbered, const Discriminator& keys,
               core::VolumeInfo& info) {
  if (numbered.at.size() < 2) return;
  const auto contrast =
      std::find_if(keys.keys.begin(), keys.keys.end(), [](const Key* key) { return !key->time; });
  if (contrast != keys.keys.end()) {
    warn(info, "frames-not-time",
         "The frames differ in " + (*contrast)->name + "; they are no times of one movement.");
    return;
  }
  const bool known =
      take_times(
          records, numbered.at, [](const FrameClock& c) { return c.offset_s; }, Provenance::stated, info) ||
      take_times(
          records, numbered.at, [](const FrameClock& c) { return c.trigger_s; }, Provenance::stated, info) ||
      take_times(
          records, numbered.at, [](const FrameClock& c) { return c.acquired_s; }, Provenance::derived,
          info) ||
      take_times(
          records, numbered.at, [](const FrameClock& c) { return c.content_s; }, Provenance::derived, info);
  if (!known && keys.by_instance)
    warn(info, "assumed-times",
         "Every place holds " + std::to_string(numbered.at.size()) +
             " slices, and only their numbers tell them apart; they were taken for times in that order.");
}

[[noreturn]] void nothing_tells_apart(const std::filesystem::path& shown, const std::vector<Place>& places) {
  std::ostringstream text;
  text << "holds ";
  if (fewest(places) == most(places))
    text << most(places) << " different slices at each of its " << places.size() << " places";
  else
    text << "between " << fewest(places) << " and " << most(places) << " different slices at each of its "
         << places.size() << " places";
  text << ", and neither times nor numbers say which belong together. Open one slice, or export the scan "
          "with one series for each time.";
  fail("no-volume", shown, text.str());
}

/// One way to lay the frames of all places out.
struct Arrangement {
  std::vector<std::vector<std::size_t>> at;  ///< empty where there is none
  std::size_t incomplete = 0;                ///< times that lack slices
  Discriminator keys;
};

Arrangement arrange(const std::vector<FrameRecord>& records, const std::vector<Place>& places,
                    const std::vector<Key>& keys) {
  Arrangement result;
  if (most(places) > 1) result.keys = tell_apart(places, keys);
  if (!result.keys.by_instance) result.at = tabulate(records, places, result.keys, result.incomplete);
  if (!result.at.empty() || fewest(places) != most(places)) return result;
  // Values that differ from place to place, as clocks do, still give an order at each.
  result.incomplete = 0;
  result.at = rank(records, places, result.keys);
  if (result.keys.by_instance && !instances_run_in_blocks(records, result.at)) result.at.clear();
  return result;
}

}  // namespace

Numbered number_frames(const std::vector<FrameRecord>& records, const std::filesystem::path& shown,
                       const SamePixels& same_pixels, core::VolumeInfo& info) {
  Numbered numbered;
  std::vector<Place> places = places_of(records, numbered.along_mm);
  const std::vector<Key> keys = keys_of(records);
  Arrangement found = arrange(records, places, keys);
  // Where keys tell frames apart they are no copies, black or not.
  if ((found.at.empty() || found.keys.by_instance) && same_pixels) {
    // A single place is a cine, which may stand still: there a copy has its original's number.
    const bool cine = places.size() == 1;
    const SamePixels is_copy = [&](const FrameRecord& a, const FrameRecord& b) {
      return (!cine || a.clock.instance == b.clock.instance) && same_pixels(a, b);
    };
    const std::size_t dropped = drop_copies(records, is_copy, places);
    if (dropped > 0) {
      found = arrange(records, places, keys);
      warn(info, "duplicate-slices",
           std::to_string(dropped) + (dropped == 1 ? " slice is a copy" : " slices are copies") +
               " of another at the same place and " + (dropped == 1 ? "was" : "were") + " left out.");
    }
  }
  if (found.at.empty()) nothing_tells_apart(shown, places);
  if (found.incomplete > 0)
    warn(info, "incomplete-times",
         std::to_string(found.incomplete) + " of " + std::to_string(found.incomplete + found.at.size()) +
             " times lack slices and were left out.");
  numbered.at = std::move(found.at);
  say_times(records, numbered, found.keys, info);
  return numbered;
}

}  // namespace palpate::imaging::reading
