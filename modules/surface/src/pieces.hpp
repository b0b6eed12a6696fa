#pragma once

#include "decimate.hpp"

#include <cstddef>

namespace palpate::surface {

/// Leaves out connected pieces: those that enclose less than `least_tissue`
/// voxels of tissue, and specks and bubbles of noise (below a ten-thousandth
/// of the largest piece, at most 64 voxels). The largest piece always stays.
/// Coordinates in voxels, wound outwards.
void drop_specks(RawSurface& surface, double least_tissue);

/// Leaves out the smallest pieces until at most `face_budget` faces are left;
/// for surfaces of more pieces than can be simplified. One piece always stays.
void drop_smallest_pieces(RawSurface& surface, std::size_t face_budget);

/// Signed volume by the divergence theorem, in the cube of the units given.
double enclosed_volume(const RawSurface& surface);

}  // namespace palpate::surface
