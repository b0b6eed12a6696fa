#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"
#include "palpate/visualization/picture.hpp"

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkUnsignedCharArray.h>

#include <cstring>

namespace palpate::visualization {
namespace {

std::vector<unsigned char> encode(const core::Picture& picture) {
  vtkNew<vtkImageData> image;
  image->SetDimensions(picture.width_px, picture.height_px, 1);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 4);
  const std::size_t row = static_cast<std::size_t>(picture.width_px) * 4;
  for (int y = 0; y < picture.height_px; ++y)  // VTK counts rows from below
    std::memcpy(image->GetScalarPointer(0, picture.height_px - 1 - y, 0),
                picture.rgba.data() + static_cast<std::size_t>(y) * row, row);
  vtkNew<vtkPNGWriter> writer;
  writer->SetInputData(image);
  writer->WriteToMemoryOn();
  writer->Write();
  const vtkUnsignedCharArray* bytes = writer->GetResult();
  if (bytes == nullptr || bytes->GetNumberOfValues() == 0)
    throw core::Error(core::ErrorKind::internal, "no-png", "The picture could not be turned into PNG.");
  const unsigned char* start = writer->GetResult()->GetPointer(0);
  return {start, start + bytes->GetNumberOfValues()};
}

}  // namespace

void save_png(const std::filesystem::path& path, const core::Picture& picture) {
  const auto expected =
      static_cast<std::size_t>(picture.width_px) * static_cast<std::size_t>(picture.height_px) * 4;
  if (picture.width_px <= 0 || picture.height_px <= 0 || picture.rgba.size() != expected)
    throw core::Error(core::ErrorKind::internal, "bad-picture", "The picture has no pixels to save.");
  const std::vector<unsigned char> bytes = encode(picture);
  core::write_file(path, bytes.data(), bytes.size());
}

}  // namespace palpate::visualization
