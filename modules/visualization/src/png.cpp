#include "palpate/core/error.hpp"
#include "palpate/visualization/picture.hpp"

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkUnsignedCharArray.h>

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <system_error>
#include <unistd.h>

namespace palpate::visualization {
namespace {

[[noreturn]] void cannot_write(const std::filesystem::path& path, const std::string& reason) {
  throw core::Error(core::ErrorKind::output, "cannot-write",
                    "The picture could not be saved as \"" + path.string() + "\": " + reason +
                        ". Choose another folder or free some space.");
}

std::string words_of(int error) { return std::error_code(error, std::generic_category()).message(); }

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

/// Writes all bytes and makes sure that they lie on the disk. 0 or errno.
int write_all(int file, const std::vector<unsigned char>& bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t wrote = ::write(file, bytes.data() + done, bytes.size() - done);
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote <= 0) return wrote < 0 ? errno : EIO;
    done += static_cast<std::size_t>(wrote);
  }
  // Devices and pipes have nothing to bring to a disk.
  if (::fsync(file) != 0 && errno != EINVAL && errno != ENOTSUP) return errno;
  return 0;
}

/// Devices such as /dev/full and pipes are written as they are; renaming over
/// them would put a file in their place.
void write_directly(const std::filesystem::path& path, const std::vector<unsigned char>& bytes) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (file < 0) cannot_write(path, words_of(errno));
  const int failure = write_all(file, bytes);
  ::close(file);
  if (failure != 0) cannot_write(path, words_of(failure));
}

}  // namespace

void save_png(const std::filesystem::path& path, const core::Picture& picture) {
  const auto expected =
      static_cast<std::size_t>(picture.width_px) * static_cast<std::size_t>(picture.height_px) * 4;
  if (picture.width_px <= 0 || picture.height_px <= 0 || picture.rgba.size() != expected)
    throw core::Error(core::ErrorKind::internal, "bad-picture", "The picture has no pixels to save.");
  std::error_code ignored;
  const auto kind = std::filesystem::status(path, ignored).type();
  if (path.filename().empty() || kind == std::filesystem::file_type::directory)
    cannot_write(path, "it is a folder, not a file name");
  const std::vector<unsigned char> bytes = encode(picture);
  if (kind != std::filesystem::file_type::regular && kind != std::filesystem::file_type::not_found &&
      kind != std::filesystem::file_type::none) {
    write_directly(path, bytes);
    return;
  }
  std::filesystem::path beside = path;
  beside += ".part" + std::to_string(::getpid());
  const int file = ::open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) cannot_write(path, words_of(errno));
  int failure = write_all(file, bytes);
  if (::close(file) != 0 && failure == 0) failure = errno;
  if (failure == 0 && std::rename(beside.c_str(), path.c_str()) != 0) failure = errno;
  if (failure != 0) {
    std::filesystem::remove(beside, ignored);
    cannot_write(path, words_of(failure));
  }
}

}  // namespace palpate::visualization
