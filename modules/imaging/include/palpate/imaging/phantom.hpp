#pragma once

#include <cstdint>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

namespace palpate::imaging {

struct PhantomParameters {
  int size = 128;          ///< voxels along the longest side, 16..512
  int frames = 1;          ///< of one heart beat, 1..64
  std::uint64_t seed = 1;
  double period_s = 0.8;   ///< of the beat; frame f is at f * period / frames
};
/// Labels of the phantom's voxels.
enum class PhantomLabel : std::uint8_t { background = 0, wall = 1, cavity = 2, valve = 3 };

struct Phantom {
  std::vector<core::Volume> frames;  ///< whole numbers in [0, 255]
  core::Volume labels;               ///< of frame 0
  core::TriangleMesh surface;        ///< the true wall of frame 0: outside and inside, LPS mm
};
/// A left ventricle of real size (about 90 mm long): a truncated ellipsoid
/// wall with cavity, apex and valve plane, seen by a probe at the apex:
/// speckle that scales with the signal, depth-dependent, a rib's shadow.
/// Myocardium around 140, cavity and background around 20 (docs/cli.md): the
/// mean over the label is within 10 of that for sizes from 64 on; in smaller
/// ones a voxel is as thick as the wall.
/// LPS, identity direction, centred on the origin: the probe looks along +y,
/// the apex is at y = -46 mm, the valve plane at y = 46 mm.
/// Deterministic in all parameters, on every machine. Throws Error(usage)
/// naming the range, Error(cancelled).
Phantom make_phantom(const PhantomParameters& parameters, const core::Progress& progress = {});

}  // namespace palpate::imaging
