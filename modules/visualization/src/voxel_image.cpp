#include "voxel_image.hpp"

#include <vtkFloatArray.h>
#include <vtkPointData.h>

namespace palpate::visualization {

bool same_geometry(const core::Volume& a, const core::Volume& b) {
  return a.empty() == b.empty() && (a.empty() || a.geometry() == b.geometry());
}

VoxelImage::VoxelImage() = default;

bool VoxelImage::set_volume(const core::Volume& volume) {
  if (volume_.data() == volume.data() && same_geometry(volume_, volume)) return false;
  volume_ = volume;
  image_->Initialize();
  if (volume.empty()) return true;
  const auto& dims = volume.dims();
  image_->SetDimensions(dims[0], dims[1], dims[2]);
  vtkNew<vtkFloatArray> values;
  // VTK has no arrays of const; it only reads these.
  values->SetArray(const_cast<float*>(volume.data()), static_cast<vtkIdType>(volume.size()), 1);
  image_->GetPointData()->SetScalars(values);
  const Eigen::Matrix4d& matrix = volume.geometry().ijk_to_lps_mm();
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) ijk_to_lps_->SetElement(row, column, matrix(row, column));
  return true;
}

}  // namespace palpate::visualization
