#pragma once

#include "lattice.hpp"

#include <cstddef>
#include <cstdint>

namespace palpate::model {

/// How many points without a lattice stand for so many voxels: as many as a
/// lattice of the stride has on average.
std::size_t scattered_count(std::size_t voxels, int stride);

/// Points spread evenly over the cells of the tissue's voxels, numbered in
/// voxel order: darts are thrown, those that fall too near to another are
/// taken back, and "too near" shrinks until there are scattered_count() of
/// them (after McCool and Fiume 1992). `tissue` are all voxels of `frame`, whose
/// stride is 1. The same for any number of threads.
PointCloud scatter(const core::Volume& volume, const LatticeFrame& frame, const Occupancy& tissue, int stride,
                   std::uint64_t seed, unsigned threads, const core::Progress& progress);

/// Edge in mm of a cube as large as what each point stands for.
double scattered_spacing_mm(const core::ImageGeometry& geometry, int stride);

}  // namespace palpate::model
