#pragma once

#include "lattice.hpp"
#include "nearest.hpp"

#include "palpate/model/generate.hpp"

namespace palpate::model {

/// What generate() and estimate() decide before any point is made.
struct Plan {
  CropBox box;
  LatticeFrame frame;
  TissueRule rule;
  Jitter jitter;
  Metric metric;
  OffsetTable table;
};
/// Throws as generate() does.
Plan make_plan(const core::Volume& volume, const TissueParameters& parameters, unsigned threads,
               const core::Progress& progress);
/// The sites of a plan's lattice, or of a part of it.
Occupancy occupy(const core::Volume& volume, Plan& plan, unsigned threads, const core::Progress& progress);
/// Points and links of what is occupied; nothing is dropped.
Tissue build(const core::Volume& volume, const TissueParameters& parameters, const Plan& plan,
             const Occupancy& occupancy, unsigned threads, const core::Progress& progress);
[[noreturn]] void throw_no_tissue(const core::Volume& volume, const TissueRule& rule, const CropBox& box);
[[noreturn]] void throw_all_dropped(std::size_t min_component, std::size_t largest_component);

/// generate() with a number of threads, which must not show in the result.
Tissue generate_with(const core::Volume& volume, const TissueParameters& parameters, unsigned threads,
                     const core::Progress& progress);

}  // namespace palpate::model
