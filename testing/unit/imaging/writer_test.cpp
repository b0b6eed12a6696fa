#include "palpate/imaging/writer.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/support.hpp"

#include <Eigen/Geometry>
#include <gdcmReader.h>
#include <gdcmStringFilter.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <itkGDCMImageIO.h>
#include <itkGDCMSeriesFileNames.h>
#include <itkImage.h>
#include <itkImageSeriesReader.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace {

namespace fs = std::filesystem;
using palpate::core::CancelToken;
using palpate::core::Error;
using palpate::core::ErrorKind;
using palpate::core::ImageGeometry;
using palpate::core::Progress;
using palpate::core::Volume;
using palpate::imaging::write;
using palpate::imaging::write_dicom_series;
using palpate::imaging::WriteOptions;
using palpate::testing::TemporaryFolder;

ImageGeometry flipped() {
  Eigen::Matrix3d direction;
  direction << 0, -1, 0, -1, 0, 0, 0, 0, -1;  // a proper rotation, axes exchanged
  return {{7, 6, 5}, {0.4, 0.7, 1.9}, {-31.7, 12.25, 5.1}, direction};
}
ImageGeometry oblique() {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  return {{7, 6, 5}, {0.4, 0.7, 1.9}, {-31.7, 12.25, 5.1}, turn};
}
ImageGeometry left_handed() {
  return {{7, 6, 5}, {0.4, 0.7, 1.9}, {-31.7, 12.25, 5.1}, Eigen::Vector3d(1, 1, -1).asDiagonal()};
}

Volume ramp(const ImageGeometry& geometry, float first = -10.0F, float step = 0.37F) {
  std::vector<float> voxels;
  for (std::size_t n = 0; n < geometry.voxel_count(); ++n)
    voxels.push_back(first + step * static_cast<float>(n));
  return {geometry, voxels};
}

struct Back {
  std::vector<std::size_t> dims;
  std::vector<double> spacing, origin;
  std::vector<std::vector<double>> direction;
  itk::ImageIOBase::IOComponentType type{};
  std::vector<char> bytes;
  const float* floats() const { return reinterpret_cast<const float*>(bytes.data()); }
};

bool ends(const std::string& name, const std::string& ending) {
  return name.size() >= ending.size() &&
         name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

Back read_back(const fs::path& path) {
  itk::ImageIOBase::Pointer io;
  if (ends(path, ".mha") || ends(path, ".mhd"))
    io = itk::MetaImageIO::New();
  else if (ends(path, ".nrrd"))
    io = itk::NrrdImageIO::New();
  else
    io = itk::NiftiImageIO::New();
  io->SetFileName(path.string());
  io->ReadImageInformation();
  Back back;
  itk::ImageIORegion region(io->GetNumberOfDimensions());
  for (unsigned axis = 0; axis < io->GetNumberOfDimensions(); ++axis) {
    back.dims.push_back(io->GetDimensions(axis));
    back.spacing.push_back(io->GetSpacing(axis));
    back.origin.push_back(io->GetOrigin(axis));
    back.direction.push_back(io->GetDirection(axis));
    region.SetSize(axis, io->GetDimensions(axis));
  }
  io->SetIORegion(region);
  back.type = io->GetComponentType();
  back.bytes.resize(static_cast<std::size_t>(io->GetImageSizeInBytes()));
  io->Read(back.bytes.data());
  return back;
}

void expect_geometry(const Back& back, const ImageGeometry& geometry, double tolerance) {
  for (unsigned axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(back.dims[axis], static_cast<std::size_t>(geometry.dims()[axis]));
    EXPECT_NEAR(back.spacing[axis], geometry.spacing_mm()[axis], tolerance);
    EXPECT_NEAR(back.origin[axis], geometry.origin_mm()[axis], tolerance * 10.0);
    for (unsigned row = 0; row < 3; ++row)
      EXPECT_NEAR(back.direction[axis][row], geometry.direction()(row, axis), tolerance)
          << row << ',' << axis;
  }
}

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

template <typename Call>
std::string output_code(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::output) << error.what();
    return error.code();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

TEST(Writer, KeepsVoxelsAndGeometryInEveryFormat) {
  const TemporaryFolder folder;
  for (const auto& geometry : {flipped(), oblique(), left_handed()})
    for (const std::string ending : {".mha", ".mhd", ".nrrd", ".nii", ".nii.gz"})
      for (const bool compress : {true, false}) {
        SCOPED_TRACE(ending + (compress ? " compressed" : ""));
        const Volume volume = ramp(geometry);
        WriteOptions options;
        options.compress = compress;
        write(folder / ("volume" + ending), {volume}, 0.0, options);
        const Back back = read_back(folder / ("volume" + ending));
        ASSERT_EQ(back.dims.size(), 3U);
        EXPECT_EQ(back.type, itk::ImageIOBase::FLOAT);
        // NIfTI holds its geometry in 32-bit floats and turns it through a
        // quaternion (1e-6 of it); the text formats hold 17 digits, of which
        // NRRD's spacing comes back as the length of a vector.
        expect_geometry(back, geometry, ending.compare(0, 4, ".nii") == 0 ? 3e-6 : 1e-14);
        ASSERT_EQ(back.bytes.size(), volume.size() * sizeof(float));
        EXPECT_EQ(std::memcmp(back.bytes.data(), volume.data(), back.bytes.size()), 0);
      }
}

TEST(Writer, LeavesOnlyItsFiles) {
  const TemporaryFolder folder;
  const Volume volume = ramp(oblique());
  write(folder / "a.mha", {volume});
  write(folder / "b.mhd", {volume});
  WriteOptions plain;
  plain.compress = false;
  write(folder / "c.MHD", {volume}, 0.0, plain);
  EXPECT_EQ(names_in(folder.path()), (std::set<std::string>{"a.mha", "b.mhd", "b.zraw", "c.MHD", "c.raw"}));
  std::ifstream header(folder / "b.mhd");
  const std::string text((std::istreambuf_iterator<char>(header)), std::istreambuf_iterator<char>());
  EXPECT_THAT(text, ::testing::HasSubstr("ElementDataFile = b.zraw"));
}

TEST(Writer, SeveralFramesMakeAFourthAxisOfTime) {
  const TemporaryFolder folder;
  const std::vector<Volume> frames{ramp(oblique(), 0.0F), ramp(oblique(), 1000.0F), ramp(oblique(), 2000.0F)};
  for (const std::string ending : {".mha", ".nrrd", ".nii.gz"}) {
    SCOPED_TRACE(ending);
    write(folder / ("beat" + ending), frames, 0.125);
    const Back back = read_back(folder / ("beat" + ending));
    ASSERT_EQ(back.dims.size(), 4U);
    EXPECT_EQ(back.dims[3], 3U);
    EXPECT_DOUBLE_EQ(back.spacing[3], 0.125);
    expect_geometry(back, oblique(), ending == ".nii.gz" ? 3e-6 : 1e-14);
    for (std::size_t f = 0; f < 3; ++f)
      EXPECT_EQ(std::memcmp(back.floats() + f * frames[f].size(), frames[f].data(), frames[f].size() * 4), 0);
  }
}

/// By the program's own reader, which need not agree with ITK: how far the
/// corners of the box of voxels are from where they were.
double largest_shift_mm(const ImageGeometry& a, const ImageGeometry& b) {
  double shift = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d ijk((corner & 1) * (a.dims()[0] - 1), (corner >> 1 & 1) * (a.dims()[1] - 1),
                              (corner >> 2) * (a.dims()[2] - 1));
    shift = std::max(shift, (a.to_lps_mm(ijk) - b.to_lps_mm(ijk)).norm());
  }
  return shift;
}

TEST(Writer, EveryFormatComesBackThroughTheReader) {
  using palpate::core::Provenance;
  const TemporaryFolder folder;
  for (const auto& geometry : {flipped(), oblique(), left_handed()})
    for (const std::string ending : {".mha", ".mhd", ".nrrd", ".nii", ".nii.gz", ".dcm"})
      for (const std::size_t count : {1U, 3U}) {
        SCOPED_TRACE(ending + ", frames: " + std::to_string(count));
        std::vector<Volume> frames;
        for (std::size_t n = 0; n < count; ++n)
          frames.push_back(ramp(geometry, 1000.0F * static_cast<float>(n), 1.0F));
        write(folder / ("a" + ending), frames, 0.125);
        const auto back = palpate::imaging::read(folder / ("a" + ending));
        ASSERT_EQ(back.frames.size(), count);
        EXPECT_EQ(back.info.geometry.dims(), geometry.dims());
        // NIfTI: 32-bit floats through a quaternion, 1e-6 of coordinates below
        // 50 mm. DICOM: decimal strings of 16 characters. The others: doubles.
        const double tolerance_mm = ending.compare(0, 4, ".nii") == 0 ? 5e-5 : 1e-10;
        EXPECT_LE(largest_shift_mm(back.info.geometry, geometry), tolerance_mm);
        // The distance of DICOM's planes is that of their positions.
        const auto third = ending == ".dcm" ? Provenance::derived : Provenance::stated;
        EXPECT_EQ(back.info.spacing_provenance,
                  (std::array<Provenance, 3>{Provenance::stated, Provenance::stated, third}));
        EXPECT_EQ(back.info.origin_provenance, Provenance::stated);
        EXPECT_EQ(back.info.direction_provenance, Provenance::stated);
        EXPECT_TRUE(back.info.patient_axes);
        for (std::size_t n = 0; n < count; ++n)
          EXPECT_EQ(std::memcmp(back.frames[n].data(), frames[n].data(), frames[n].size() * sizeof(float)),
                    0);
        if (count == 1) continue;
        EXPECT_EQ(back.info.frame_times_s, (std::vector<double>{0.0, 0.125, 0.25}));
        EXPECT_EQ(back.info.time_provenance, Provenance::stated);
      }
}

TEST(Writer, TimesThatNobodyKnowsStayUnknown) {
  const TemporaryFolder folder;
  const std::vector<Volume> frames{ramp(oblique(), 0.0F), ramp(oblique(), 1000.0F)};
  for (const std::string ending : {".mha", ".nrrd", ".nii", ".dcm"}) {
    write(folder / ("a" + ending), frames);
    const auto back = palpate::imaging::read(folder / ("a" + ending));
    EXPECT_EQ(back.info.frames, 2) << ending;
    EXPECT_NE(back.info.time_provenance, palpate::core::Provenance::stated) << ending;
  }
}

TEST(Writer, UnevenTimesBecomeTheirMeanStepOutsideDicom) {
  const TemporaryFolder folder;
  const std::vector<Volume> frames{ramp(oblique(), 0.0F), ramp(oblique(), 1000.0F), ramp(oblique(), 2000.0F)};
  WriteOptions options;
  options.frame_times_s = {1.0, 1.125, 1.5};
  write(folder / "a.mha", frames, 0.0, options);
  write(folder / "a.dcm", frames, 0.0, options);
  EXPECT_DOUBLE_EQ(read_back(folder / "a.mha").spacing[3], 0.25);
  EXPECT_EQ(palpate::imaging::read(folder / "a.dcm").info.frame_times_s,
            (std::vector<double>{0.0, 0.125, 0.5}));
}

TEST(Writer, RoundsAndClampsToEightBits) {
  const TemporaryFolder folder;
  const ImageGeometry geometry({6, 1, 1}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  WriteOptions options;
  options.pixel_type = "uint8";
  write(folder / "a.mha", {Volume(geometry, std::vector<float>{-3.0F, 0.49F, 0.5F, 127.6F, 254.6F, 300.0F})},
        0.0, options);
  const Back back = read_back(folder / "a.mha");
  EXPECT_EQ(back.type, itk::ImageIOBase::UCHAR);
  const std::vector<unsigned char> bytes(back.bytes.begin(), back.bytes.end());
  EXPECT_EQ(bytes, (std::vector<unsigned char>{0, 0, 1, 128, 255, 255}));
}

TEST(Writer, ReplacesAnOlderFileAndWritesThroughALink) {
  const TemporaryFolder folder;
  const Volume volume = ramp(oblique());
  std::ofstream(folder / "real.mha") << "older";
  fs::create_symlink("real.mha", folder / "link.mha");
  write(folder / "link.mha", {volume});
  EXPECT_TRUE(fs::is_symlink(folder / "link.mha"));
  EXPECT_FALSE(fs::is_symlink(folder / "real.mha"));
  EXPECT_EQ(read_back(folder / "real.mha").bytes.size(), volume.size() * 4);
}

TEST(Writer, RefusesOtherEndingsAndPixelTypes) {
  const TemporaryFolder folder;
  for (const char* name : {"a.png", "a", ".mha", "a.mha.gz", "a.nhdr", "a.gz"}) try {
      write(folder / name, {ramp(oblique())});
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::usage) << name;
      EXPECT_THAT(error.what(), ::testing::HasSubstr(".nii.gz"));
    }
  WriteOptions options;
  options.pixel_type = "int16";
  EXPECT_THROW(write(folder / "a.mha", {ramp(oblique())}, 0.0, options), Error);
  EXPECT_THROW(write(folder / "a.mha", {}), Error);
  EXPECT_THROW(write(folder / "a.mha", {ramp(oblique()), ramp(flipped())}), Error);
  EXPECT_TRUE(names_in(folder.path()).empty());
}

TEST(Writer, SaysWhyItCannotWriteAndLeavesNothing) {
  const TemporaryFolder folder;
  const Volume volume = ramp(oblique());
  std::ofstream(folder / "file") << "x";
  fs::create_directory(folder / "folder.mha");
  fs::create_symlink("/dev/full", folder / "device.mha");
  EXPECT_EQ(output_code([&] { write(folder / "none" / "a.mha", {volume}); }), "no-such-folder");
  EXPECT_EQ(output_code([&] { write(folder / "file" / "a.mha", {volume}); }), "no-such-folder");
  EXPECT_EQ(output_code([&] { write(folder / "folder.mha", {volume}); }), "is-a-folder");
  // Renaming a file over a device would remove the device.
  EXPECT_NE(output_code([&] { write(folder / "device.mha", {volume}); }), "");
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
  // Nobody, not even the superuser, can make a folder here.
  EXPECT_EQ(output_code([&] { write("/proc/a.mha", {volume}); }), "no-permission");
  EXPECT_EQ(output_code([&] { write_dicom_series("/proc/series", volume); }), "no-permission");
  EXPECT_EQ(output_code([&] { write_dicom_series(folder / "none" / "series", volume); }), "no-such-folder");
  EXPECT_EQ(output_code([&] { write_dicom_series(folder.path(), volume); }), "exists");
  EXPECT_EQ(output_code([&] { write_dicom_series(folder / "file", volume); }), "exists");
  EXPECT_EQ(names_in(folder.path()), (std::set<std::string>{"device.mha", "file", "folder.mha"}));
  EXPECT_TRUE(names_in(folder / "folder.mha").empty());
}

/// In a child process under a limit on file sizes, as a full disk would be:
/// 0 when the write ended with Error(output).
template <typename Call>
int under_a_size_limit(rlim_t bytes, const Call& call) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{bytes, bytes};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    try {
      call();
    } catch (const Error& error) {
      ::_exit(error.kind() == ErrorKind::output ? 0 : 3);
    } catch (...) {
      ::_exit(4);
    }
    ::_exit(5);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

TEST(Writer, AFullDiskIsAnErrorAndTheOlderFileStays) {
  const TemporaryFolder folder;
  const ImageGeometry geometry({64, 64, 16}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  std::vector<float> voxels;
  std::uint32_t state = 1;
  for (std::size_t n = 0; n < geometry.voxel_count(); ++n) {  // compresses badly
    state = state * 1664525U + 1013904223U;
    voxels.push_back(static_cast<float>(state));
  }
  const Volume volume(geometry, voxels);
  for (const std::string ending : {".mha", ".mhd", ".nrrd", ".nii", ".nii.gz"}) {
    const auto path = folder / ("full" + ending);
    std::ofstream(path) << "older";
    for (const bool compress : {true, false})
      // Cut in the header, between header and voxels, in the voxels, near the end.
      for (const rlim_t bytes : {0, 1, 20, 100, 352, 5000, 60000, 200000}) {
        WriteOptions options;
        options.compress = compress;
        EXPECT_EQ(under_a_size_limit(bytes, [&] { write(path, {volume}, 0.0, options); }), 0)
            << ending << ' ' << compress << ' ' << bytes;
      }
    EXPECT_EQ(fs::file_size(path), 5U);
    fs::remove(path);
    EXPECT_TRUE(names_in(folder.path()).empty()) << ending;
  }
  EXPECT_EQ(under_a_size_limit(3000, [&] { write_dicom_series(folder / "series", volume); }), 0);
  EXPECT_TRUE(names_in(folder.path()).empty());
}

TEST(Writer, CancelledItLeavesNothing) {
  const TemporaryFolder folder;
  for (const double at : {0.0, 0.5}) {
    const CancelToken cancel;
    const Progress progress(
        [&](double fraction, const std::string&) {
          if (fraction >= at) cancel.cancel();
        },
        cancel);
    // What was asked for last is written whole or not at all.
    try {
      write(folder / "a.mha", {ramp(oblique())}, 0.0, {}, progress);
      EXPECT_EQ(names_in(folder.path()), std::set<std::string>{"a.mha"});
      fs::remove(folder / "a.mha");
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::cancelled);
    }
    try {
      write_dicom_series(folder / "series", ramp(oblique()), progress);
      ADD_FAILURE() << "ran to its end";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::cancelled);
    }
    EXPECT_TRUE(names_in(folder.path()).empty());
  }
}

using Slices = itk::Image<float, 3>;

Slices::Pointer read_series(const fs::path& folder) {
  const auto names = itk::GDCMSeriesFileNames::New();
  names->SetDirectory(folder.string());
  const auto reader = itk::ImageSeriesReader<Slices>::New();
  reader->SetImageIO(itk::GDCMImageIO::New());
  reader->SetFileNames(names->GetInputFileNames());
  reader->ForceOrthogonalDirectionOff();
  reader->Update();
  return reader->GetOutput();
}

/// The largest difference of values, compared at the same place in LPS.
double largest_difference(const Slices& image, const Volume& volume) {
  double largest = 0.0;
  for (std::size_t n = 0; n < volume.size(); ++n) {
    const auto [i, j, k] = volume.geometry().ijk_of(n);
    const Eigen::Vector3d place = volume.geometry().to_lps_mm(Eigen::Vector3d(i, j, k));
    Slices::PointType point;
    for (unsigned axis = 0; axis < 3; ++axis) point[axis] = place[axis];
    Slices::IndexType index;
    if (!image.TransformPhysicalPointToIndex(point, index)) return 1e9;
    Slices::PointType centre;
    image.TransformIndexToPhysicalPoint(index, centre);
    // Positions are decimal strings of 16 characters.
    if (centre.EuclideanDistanceTo(point) > 1e-6) return 2e9;
    largest = std::max(largest, std::abs(static_cast<double>(image.GetPixel(index)) - volume.at(i, j, k)));
  }
  return largest;
}

TEST(DicomSeries, EveryVoxelIsWhereItWas) {
  const TemporaryFolder folder;
  int n = 0;
  for (const auto& geometry : {flipped(), oblique(), left_handed()}) {
    const Volume volume = ramp(geometry, 0.0F, 1.0F);  // whole numbers are stored as they are
    const auto path = folder / ("series" + std::to_string(n++));
    write_dicom_series(path, volume);
    EXPECT_EQ(names_in(path).size(), 5U);
    EXPECT_EQ(largest_difference(*read_series(path), volume), 0.0);
  }
}

TEST(DicomSeries, OtherValuesTakeSixteenBitsOverTheirRange) {
  const TemporaryFolder folder;
  const Volume volume = ramp(oblique(), -10.0F, 0.37F);
  write_dicom_series(folder / "series", volume);
  // Half a step of range / 65535, and the rounding of floats near 70.
  const double step = (static_cast<double>(volume.range().max) - volume.range().min) / 65535.0;
  EXPECT_LE(largest_difference(*read_series(folder / "series"), volume), 0.5 * step + 1e-5);
}

std::string tag_of(const fs::path& file, std::uint16_t group, std::uint16_t element) {
  gdcm::Reader reader;
  reader.SetFileName(file.c_str());
  if (!reader.Read()) return "unreadable";
  gdcm::StringFilter filter;
  filter.SetFile(reader.GetFile());
  std::string text = filter.ToString(gdcm::Tag(group, element));
  while (!text.empty() && (text.back() == ' ' || text.back() == '\0')) text.pop_back();
  return text;
}

TEST(DicomSeries, SaysWhatItIsAndNamesNobody) {
  const TemporaryFolder folder;
  write_dicom_series(folder / "a", ramp(oblique(), 0.0F, 1.0F));
  write_dicom_series(folder / "b", ramp(oblique(), 0.0F, 1.0F));
  write_dicom_series(folder / "c", ramp(flipped(), 0.0F, 1.0F));
  const auto first = [&](const char* series) { return folder / series / "slice-0001.dcm"; };
  EXPECT_EQ(tag_of(first("a"), 0x0008, 0x0016), "1.2.840.10008.5.1.4.1.1.4");
  EXPECT_EQ(tag_of(first("a"), 0x0008, 0x0060), "US");
  EXPECT_EQ(tag_of(first("a"), 0x0018, 0x0020), "RM");
  EXPECT_EQ(tag_of(first("a"), 0x0010, 0x0010), "PHANTOM^LEFT VENTRICLE");
  EXPECT_EQ(tag_of(first("a"), 0x0008, 0x0020), "");
  std::set<std::string> instances;
  for (const auto& name : names_in(folder / "a")) {
    const auto uid = tag_of(folder / "a" / name, 0x0008, 0x0018);
    EXPECT_THAT(uid, ::testing::StartsWith("2.25."));
    EXPECT_LE(uid.size(), 64U);
    instances.insert(uid);
    EXPECT_EQ(uid, tag_of(folder / "b" / name, 0x0008, 0x0018)) << "the same content has the same UID";
    EXPECT_EQ(tag_of(folder / "a" / name, 0x0020, 0x000E), tag_of(first("a"), 0x0020, 0x000E));
  }
  EXPECT_EQ(instances.size(), 5U);
  EXPECT_NE(tag_of(first("a"), 0x0020, 0x000E), tag_of(first("c"), 0x0020, 0x000E));
}

}  // namespace
