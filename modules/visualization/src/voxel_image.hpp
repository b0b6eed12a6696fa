#pragma once

#include "palpate/core/volume.hpp"

#include <vtkImageData.h>
#include <vtkMatrix4x4.h>
#include <vtkNew.h>

namespace palpate::visualization {

/// Voxels as a VTK image in pure index space, sharing their memory.
class VoxelImage {
 public:
  VoxelImage();
  /// False when nothing changed.
  bool set_volume(const core::Volume& volume);
  const core::Volume& volume() const noexcept { return volume_; }
  vtkImageData* image() const { return image_; }
  vtkMatrix4x4* ijk_to_lps() const { return ijk_to_lps_; }

 private:
  core::Volume volume_;  ///< keeps the voxels alive while VTK points at them
  vtkNew<vtkImageData> image_;
  vtkNew<vtkMatrix4x4> ijk_to_lps_;
};

/// Both empty, or at the same place.
bool same_geometry(const core::Volume& a, const core::Volume& b);

}  // namespace palpate::visualization
