#pragma once

#include "lattice.hpp"
#include "nearest.hpp"

#include "palpate/model/tissue.hpp"

#include <array>
#include <vector>

namespace palpate::model {

/// Everything that link generation needs to know about the lattice.
struct LatticePoints {
  const PointCloud& points;
  const Occupancy& occupancy;
  LatticeFrame frame;
  const core::ImageGeometry& geometry;
};

/// The steps of a lattice rule (six, lattice18, lattice26) to the neighbours
/// with a higher number, in rising order: half of all; none for `nearest`.
std::vector<Cell> half_stencil(LinkRule rule);
/// To the neighbours that exist.
LinkGraph link_neighbours(const LatticePoints& lattice, const std::vector<Cell>& half_stencil,
                          unsigned threads, const core::Progress& progress);
LinkGraph link_mutual_nearest(const LatticePoints& lattice, const OffsetTable& table, const Metric& metric,
                              const Jitter& jitter, int max_links, unsigned threads,
                              const core::Progress& progress);
/// By positions alone; `edge_mm` is a first guess at the cells of the search.
LinkGraph link_by_positions(const PointCloud& points, double edge_mm, int max_links, unsigned threads,
                            const core::Progress& progress);

}  // namespace palpate::model
