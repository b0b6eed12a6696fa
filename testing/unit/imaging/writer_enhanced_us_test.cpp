#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/imaging/writer.hpp"
#include "palpate/testing/support.hpp"

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dctk.h>
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
using palpate::imaging::WriteOptions;
using palpate::testing::TemporaryFolder;
using ::testing::HasSubstr;

ImageGeometry straight() { return {{5, 4, 3}, {0.4, 0.7, 1.9}, {-31.7, 12.25, 5.1}}; }
ImageGeometry oblique() {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  return {{7, 6, 5}, {1.0 / 3.0, 0.7, 1.9}, {-31.7, 12.25, 5.1}, turn};
}
ImageGeometry left_handed() {
  Eigen::Matrix3d direction;
  direction << 0, -1, 0, -1, 0, 0, 0, 0, 1;
  return {{7, 6, 5}, {0.4, 0.7, 1.9}, {-31.7, 12.25, 5.1}, direction};
}

Volume ramp(const ImageGeometry& geometry, float first, float step) {
  std::vector<float> voxels;
  for (std::size_t n = 0; n < geometry.voxel_count(); ++n)
    voxels.push_back(first + step * static_cast<float>(n));
  return {geometry, voxels};
}

WriteOptions dated() {
  WriteOptions options;
  options.dicom.content_date_time = "20240131120001";
  return options;
}

std::string program_in_path(const std::string& name) {
  std::istringstream folders(std::getenv("PATH") == nullptr ? "" : std::getenv("PATH"));
  for (std::string folder; std::getline(folders, folder, ':');)
    if (::access((fs::path(folder) / name).c_str(), X_OK) == 0) return fs::path(folder) / name;
  return {};
}

/// A file as DCMTK alone sees it.
class Seen {
 public:
  explicit Seen(const fs::path& path) {
    EXPECT_TRUE(file_.loadFile(path.c_str()).good());
    shared_ = item(*file_.getDataset(), DCM_SharedFunctionalGroupsSequence);
  }
  DcmItem& set() { return *file_.getDataset(); }
  DcmItem& shared() { return *shared_; }
  DcmItem& plane(unsigned long n) { return *item(set(), DCM_PerFrameFunctionalGroupsSequence, n); }
  static DcmItem* item(DcmItem& parent, const DcmTagKey& sequence, unsigned long n = 0) {
    DcmItem* found = nullptr;
    EXPECT_TRUE(parent.findAndGetSequenceItem(sequence, found, static_cast<signed long>(n)).good())
        << sequence.toString();
    return found;
  }
  static std::string text(DcmItem& parent, const DcmTagKey& tag) {
    OFString value;
    parent.findAndGetOFStringArray(tag, value);
    return value.c_str();
  }
  static Eigen::VectorXd doubles(DcmItem& parent, const DcmTagKey& tag) {
    const Float64* values = nullptr;
    unsigned long count = 0;
    EXPECT_TRUE(parent.findAndGetFloat64Array(tag, values, &count).good()) << tag.toString();
    return Eigen::Map<const Eigen::VectorXd>(values, static_cast<Eigen::Index>(count));
  }
  /// The numbers of a decimal string.
  static Eigen::VectorXd decimals(DcmItem& parent, const DcmTagKey& tag) {
    std::vector<double> values;
    std::istringstream list(text(parent, tag));
    for (std::string one; std::getline(list, one, '\\');) {
      EXPECT_LE(one.size(), 16U);
      values.push_back(std::stod(one));
    }
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  }
  double value(std::size_t n) {
    const bool wide = text(set(), DCM_BitsAllocated) == "16";
    double stored = 0.0;
    if (wide) {
      const Uint16* words = nullptr;
      EXPECT_TRUE(set().findAndGetUint16Array(DCM_PixelData, words).good());
      stored = words[n];
    } else {
      const Uint8* bytes = nullptr;
      EXPECT_TRUE(set().findAndGetUint8Array(DCM_PixelData, bytes).good());
      stored = bytes[n];
    }
    if (!shared().tagExists(DCM_RealWorldValueMappingSequence)) return stored;
    DcmItem& map = *item(shared(), DCM_RealWorldValueMappingSequence);
    return stored * doubles(map, DCM_RealWorldValueSlope)[0] + doubles(map, DCM_RealWorldValueIntercept)[0];
  }

 private:
  DcmFileFormat file_;
  DcmItem* shared_ = nullptr;
};

/// Every plane's place by the index (i, j, k) of the volume that was written.
void expect_places(Seen& seen, const ImageGeometry& geometry, std::size_t frames) {
  const Eigen::VectorXd spacing =
      Seen::decimals(*Seen::item(seen.shared(), DCM_PixelMeasuresSequence), DCM_PixelSpacing);
  // Decimal strings have 16 characters, of which a sign, a point and leading
  // zeros take some: 1e-12 of numbers below 100.
  EXPECT_NEAR(spacing[0], geometry.spacing_mm()[1], 1e-12);
  EXPECT_NEAR(spacing[1], geometry.spacing_mm()[0], 1e-12);
  const Eigen::VectorXd volume_axes = Seen::doubles(
      *Seen::item(seen.shared(), DCM_PlaneOrientationVolumeSequence), DCM_ImageOrientationVolume);
  const Eigen::VectorXd patient_axes =
      Seen::decimals(*Seen::item(seen.shared(), DCM_PlaneOrientationSequence), DCM_ImageOrientationPatient);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 2; ++column) {
      EXPECT_EQ(volume_axes[3 * column + row], geometry.direction()(row, column));
      EXPECT_NEAR(patient_axes[3 * column + row], geometry.direction()(row, column), 1e-12);
    }
  const auto planes = static_cast<std::size_t>(geometry.dims()[2]);
  for (std::size_t n = 0; n < planes * frames; ++n) {
    const Eigen::Vector3d expected = geometry.to_lps_mm({0, 0, static_cast<double>(n % planes)});
    DcmItem& group = seen.plane(n);
    const Eigen::VectorXd in_volume =
        Seen::doubles(*Seen::item(group, DCM_PlanePositionVolumeSequence), DCM_ImagePositionVolume);
    const Eigen::VectorXd in_patient =
        Seen::decimals(*Seen::item(group, DCM_PlanePositionSequence), DCM_ImagePositionPatient);
    for (int row = 0; row < 3; ++row) {
      EXPECT_EQ(in_volume[row], expected[row]);
      EXPECT_NEAR(in_patient[row], expected[row], 1e-11);
    }
  }
}

TEST(EnhancedUs, DcmtkFindsGeometryTimesAndVoxels) {
  const TemporaryFolder folder;
  for (const auto& geometry : {straight(), oblique(), left_handed()}) {
    WriteOptions options = dated();
    options.frame_times_s = {0.5, 0.54, 0.6125};  // not even
    const std::vector<Volume> frames{ramp(geometry, 0, 1), ramp(geometry, 300, 2), ramp(geometry, 65000, 1)};
    write(folder / "a.dcm", frames, 0.0, options);
    Seen seen(folder / "a.dcm");
    EXPECT_EQ(Seen::text(seen.set(), DCM_SOPClassUID), "1.2.840.10008.5.1.4.1.1.6.2");
    EXPECT_EQ(Seen::text(seen.set(), DCM_Rows), std::to_string(geometry.dims()[1]));
    EXPECT_EQ(Seen::text(seen.set(), DCM_Columns), std::to_string(geometry.dims()[0]));
    EXPECT_EQ(Seen::text(seen.set(), DCM_NumberOfFrames), std::to_string(3 * geometry.dims()[2]));
    EXPECT_EQ(Seen::text(seen.set(), DCM_DimensionOrganizationType), "3D_TEMPORAL");
    EXPECT_EQ(Seen::text(seen.set(), DCM_UltrasoundAcquisitionGeometry), "PATIENT");
    EXPECT_EQ(Seen::text(seen.set(), DCM_BitsAllocated), "16");
    expect_places(seen, geometry, 3);
    const auto planes = static_cast<std::size_t>(geometry.dims()[2]);
    const std::array<double, 3> times{0.0, 0.54 - 0.5, 0.6125 - 0.5};
    for (std::size_t n = 0; n < 3 * planes; ++n) {
      EXPECT_EQ(Seen::doubles(*Seen::item(seen.plane(n), DCM_TemporalPositionSequence),
                              DCM_TemporalPositionTimeOffset)[0],
                times[n / planes]);
      EXPECT_EQ(Seen::text(*Seen::item(seen.plane(n), DCM_FrameContentSequence), DCM_DimensionIndexValues),
                std::to_string(n / planes + 1) + "\\" + std::to_string(n % planes + 1) + "\\1");
    }
    const std::size_t size = frames.front().size();
    for (std::size_t n = 0; n < 3 * size; ++n) ASSERT_EQ(seen.value(n), frames[n / size].data()[n % size]);
  }
}

TEST(EnhancedUs, WholeGreysAreExactAndOthersWithinTheirStep) {
  const TemporaryFolder folder;
  write(folder / "8.dcm", {ramp(straight(), 0, 4)}, 0.0, dated());
  write(folder / "16.dcm", {ramp(straight(), 0, 1000)}, 0.0, dated());
  const Volume fractions = ramp(oblique(), -10.0F, 0.37F);
  write(folder / "real.dcm", {fractions}, 0.0, dated());
  Seen eight(folder / "8.dcm");
  EXPECT_EQ(Seen::text(eight.set(), DCM_BitsStored), "8");
  EXPECT_EQ(Seen::text(eight.set(), DCM_HighBit), "7");
  Seen sixteen(folder / "16.dcm");
  EXPECT_EQ(Seen::text(sixteen.set(), DCM_BitsStored), "16");
  for (std::size_t n = 0; n < 60; ++n) {
    EXPECT_EQ(eight.value(n), 4.0 * static_cast<double>(n));
    EXPECT_EQ(sixteen.value(n), 1000.0 * static_cast<double>(n));
  }
  Seen real(folder / "real.dcm");
  EXPECT_EQ(Seen::text(real.set(), DCM_RescaleSlope), "1");
  const double step = (static_cast<double>(fractions.range().max) - fractions.range().min) / 65535.0;
  for (std::size_t n = 0; n < fractions.size(); ++n)
    // Half a step, and the rounding of the sum.
    ASSERT_NEAR(real.value(n), fractions.data()[n], 0.5 * step + 1e-12);
}

TEST(EnhancedUs, EightBitsOnDemandAndAnOddNumberOfVoxels) {
  const TemporaryFolder folder;
  const ImageGeometry geometry({3, 1, 1}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  WriteOptions options = dated();
  options.pixel_type = "uint8";
  write(folder / "a.dcm", {Volume(geometry, std::vector<float>{-3.0F, 127.6F, 300.0F})}, 0.0, options);
  Seen seen(folder / "a.dcm");
  EXPECT_EQ(seen.value(0), 0.0);
  EXPECT_EQ(seen.value(1), 128.0);
  EXPECT_EQ(seen.value(2), 255.0);
  EXPECT_EQ(fs::file_size(folder / "a.dcm") % 2, 0U);
}

TEST(EnhancedUs, WithoutKnownAxesThereIsNoPatientFrame) {
  const TemporaryFolder folder;
  WriteOptions options = dated();
  options.dicom.patient_axes = false;
  write(folder / "a.dcm", {ramp(oblique(), 0, 1)}, 0.0, options);
  Seen seen(folder / "a.dcm");
  EXPECT_NE(Seen::text(seen.set(), DCM_UltrasoundAcquisitionGeometry), "PATIENT");
  EXPECT_FALSE(seen.shared().tagExists(DCM_PlaneOrientationSequence));
  EXPECT_FALSE(seen.plane(0).tagExists(DCM_PlanePositionSequence));
  EXPECT_FALSE(seen.set().tagExists(DCM_PatientFrameOfReferenceSource));
  const Eigen::VectorXd place =
      Seen::doubles(*Seen::item(seen.plane(2), DCM_PlanePositionVolumeSequence), DCM_ImagePositionVolume);
  EXPECT_EQ(Eigen::Vector3d(place), oblique().to_lps_mm({0, 0, 2}));
}

TEST(EnhancedUs, UnknownTimesAreNotInvented) {
  const TemporaryFolder folder;
  write(folder / "a.dcm", {ramp(straight(), 0, 1), ramp(straight(), 1, 1)}, 0.0, dated());
  Seen seen(folder / "a.dcm");
  EXPECT_FALSE(seen.plane(0).tagExists(DCM_TemporalPositionSequence));
  EXPECT_EQ(Seen::text(*Seen::item(seen.plane(3), DCM_FrameContentSequence), DCM_TemporalPositionIndex), "2");
}

TEST(EnhancedUs, NamesNobodyUnlessTold) {
  const TemporaryFolder folder;
  WriteOptions options = dated();
  write(folder / "a.dcm", {ramp(straight(), 0, 1)}, 0.0, options);
  write(folder / "again.dcm", {ramp(straight(), 0, 1)}, 0.0, options);
  options.dicom.patient_name = "M\xC3\xBCller^Anna";
  options.dicom.patient_id = "17";
  options.dicom.derivation = "median:radius=1";
  write(folder / "named.dcm", {ramp(straight(), 0, 1)}, 0.0, options);
  Seen nobody(folder / "a.dcm");
  EXPECT_EQ(Seen::text(nobody.set(), DCM_PatientName), "ANONYMOUS");
  for (const auto& tag : {DCM_PatientID, DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyDate, DCM_StudyTime,
                          DCM_ReferringPhysicianName, DCM_AccessionNumber})
    EXPECT_EQ(Seen::text(nobody.set(), tag), "") << tag.toString();
  EXPECT_EQ(Seen::text(nobody.set(), DCM_ContentDate), "20240131");
  Seen named(folder / "named.dcm");
  EXPECT_EQ(Seen::text(named.set(), DCM_PatientName), "M\xC3\xBCller^Anna");
  EXPECT_EQ(Seen::text(named.set(), DCM_PatientID), "17");
  EXPECT_EQ(Seen::text(named.set(), DCM_SpecificCharacterSet), "ISO_IR 192");
  EXPECT_EQ(Seen::text(*Seen::item(named.shared(), DCM_DerivationImageSequence), DCM_DerivationDescription),
            "median:radius=1");

  std::set<std::string> uids;
  for (const auto& tag :
       {DCM_SOPInstanceUID, DCM_StudyInstanceUID, DCM_SeriesInstanceUID, DCM_FrameOfReferenceUID,
        DCM_VolumeFrameOfReferenceUID, DCM_SynchronizationFrameOfReferenceUID}) {
    const std::string uid = Seen::text(nobody.set(), tag);
    EXPECT_THAT(uid, ::testing::StartsWith("2.25."));
    EXPECT_LE(uid.size(), 64U);
    uids.insert(uid);
    EXPECT_NE(uid, Seen::text(named.set(), tag));
  }
  EXPECT_EQ(uids.size(), 6U);
  Seen again(folder / "again.dcm");
  EXPECT_EQ(Seen::text(again.set(), DCM_SOPInstanceUID), Seen::text(nobody.set(), DCM_SOPInstanceUID))
      << "the same content has the same UID";
}

TEST(EnhancedUs, TheReaderBringsBackFractionsTimesAndUnknownAxes) {
  const TemporaryFolder folder;
  WriteOptions options = dated();
  options.frame_times_s = {0.0, 0.04, 0.09};
  const std::vector<Volume> frames{ramp(oblique(), -10.0F, 0.37F), ramp(oblique(), 0.0F, 0.11F),
                                   ramp(oblique(), 5.0F, 0.02F)};
  write(folder / "known.dcm", frames, 0.0, options);
  options.dicom.patient_axes = false;
  write(folder / "unknown.dcm", frames, 0.0, options);
  const double step = (static_cast<double>(frames[0].range().max) + 10.0) / 65535.0;
  for (const bool known : {true, false}) {
    const auto back = palpate::imaging::read(folder / (known ? "known.dcm" : "unknown.dcm"));
    EXPECT_EQ(back.info.sop_class, "1.2.840.10008.5.1.4.1.1.6.2");
    EXPECT_EQ(back.info.patient_axes, known);
    EXPECT_EQ(back.info.frame_times_s, options.frame_times_s);
    // Both frames of reference have the same numbers, the patient's as
    // decimal strings.
    EXPECT_TRUE(back.info.geometry.ijk_to_lps_mm().isApprox(oblique().ijk_to_lps_mm(), 1e-12));
    ASSERT_EQ(back.frames.size(), 3U);
    for (std::size_t f = 0; f < 3; ++f)
      for (std::size_t n = 0; n < frames[f].size(); ++n)
        // Half a step, and the rounding of floats near 80.
        ASSERT_NEAR(back.frames[f].data()[n], frames[f].data()[n], 0.5 * step + 1e-5);
  }
}

TEST(EnhancedUs, DciodvfyFindsNoError) {
  const std::string program = program_in_path("dciodvfy");
  if (program.empty()) GTEST_SKIP() << "dciodvfy is not installed (package dicom3tools)";
  const TemporaryFolder folder;
  WriteOptions filtered = dated();
  filtered.dicom.derivation = "median:radius=1";
  WriteOptions volume_only = dated();
  volume_only.dicom.patient_axes = false;
  WriteOptions timed = dated();
  timed.frame_times_s = {0.0, 0.04, 0.09};
  const std::vector<Volume> beat{ramp(oblique(), 0, 1), ramp(oblique(), 300, 1), ramp(oblique(), 900, 1)};
  const ImageGeometry one({9, 7, 1}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  write(folder / "3d.dcm", {ramp(straight(), 0, 1)}, 0.0, filtered);
  write(folder / "oblique.dcm", {ramp(oblique(), 0, 1)}, 0.0, dated());
  write(folder / "left.dcm", {ramp(left_handed(), 0, 1)}, 0.0, dated());
  write(folder / "4d.dcm", beat, 0.0, timed);
  write(folder / "4d-untimed.dcm", beat, 0.0, dated());
  write(folder / "16.dcm", {ramp(straight(), 0, 1000)}, 0.0, dated());
  write(folder / "real.dcm", {ramp(oblique(), -10.0F, 0.37F)}, 0.0, filtered);
  write(folder / "flat.dcm", {ramp(straight(), 0.5F, 0)}, 0.0, dated());
  write(folder / "plane.dcm", {ramp(one, 0, 1)}, 0.0, dated());
  write(folder / "volume.dcm", {ramp(straight(), 0, 1)}, 0.0, volume_only);
  std::size_t checked = 0;
  for (const auto& entry : fs::directory_iterator(folder.path())) {
    const auto result = palpate::testing::run_program(program, {entry.path().string()});
    EXPECT_EQ(result.exit_code, 0) << entry.path();
    EXPECT_THAT(result.error, HasSubstr("EnhancedUltrasoundVolume")) << "it was not checked as what it is";
    EXPECT_THAT(result.out + result.error, ::testing::Not(HasSubstr("Error"))) << entry.path();
    ++checked;
  }
  EXPECT_EQ(checked, 10U);
}

template <typename Call>
std::string error_code(ErrorKind kind, const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind) << error.what();
    return error.code();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

TEST(EnhancedUs, RefusesWhatTheFormatCannotHold) {
  const TemporaryFolder folder;
  Eigen::Matrix3d sheared = Eigen::Matrix3d::Identity();
  sheared(0, 2) = 0.1;
  const ImageGeometry tilted({4, 4, 4}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero(), sheared);
  const ImageGeometry wide({65536, 1, 1}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  EXPECT_EQ(error_code(ErrorKind::output, [&] { write(folder / "a.dcm", {ramp(tilted, 0, 1)}); }),
            "oblique-axes");
  EXPECT_EQ(error_code(ErrorKind::output, [&] { write(folder / "a.dcm", {ramp(wide, 0, 0)}); }), "too-large");
  WriteOptions options;
  options.dicom.content_date_time = "yesterday";
  EXPECT_EQ(
      error_code(ErrorKind::usage, [&] { write(folder / "a.dcm", {ramp(straight(), 0, 1)}, 0.0, options); }),
      "usage");
  WriteOptions backwards;
  backwards.frame_times_s = {0.2, 0.1};
  const std::vector<Volume> two{ramp(straight(), 0, 1), ramp(straight(), 1, 1)};
  EXPECT_EQ(error_code(ErrorKind::usage, [&] { write(folder / "a.dcm", two, 0.0, backwards); }), "usage");
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(EnhancedUs, CancelledItLeavesNothing) {
  const TemporaryFolder folder;
  const std::vector<Volume> frames{ramp(oblique(), 0, 1), ramp(oblique(), 1, 1)};
  double last = 0.0;
  write(folder / "whole.dcm", frames, 0.1, dated(),
        Progress(
            [&](double fraction, const std::string&) {
              EXPECT_GE(fraction, last);
              last = fraction;
            },
            CancelToken()));
  EXPECT_EQ(last, 1.0);
  fs::remove(folder / "whole.dcm");
  for (const double at : {0.0, 0.2, 0.5, 0.9}) {
    const CancelToken cancel;
    const Progress progress(
        [&](double fraction, const std::string&) {
          if (fraction >= at) cancel.cancel();
        },
        cancel);
    EXPECT_EQ(
        error_code(ErrorKind::cancelled, [&] { write(folder / "a.dcm", frames, 0.1, dated(), progress); }),
        "cancelled");
    EXPECT_TRUE(fs::is_empty(folder.path())) << at;
  }
}

TEST(EnhancedUs, AFullDiskIsAnErrorAndTheOlderFileStays) {
  const TemporaryFolder folder;
  const auto path = folder / "a.dcm";
  std::ofstream(path) << "older";
  const Volume volume =
      ramp(ImageGeometry({64, 64, 16}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()), 0, 1);
  // In the preamble, the header, at its end, in the voxels, before the last byte.
  for (const rlim_t bytes :
       {rlim_t{0}, rlim_t{100}, rlim_t{2000}, rlim_t{20000}, rlim_t{100000}, rlim_t{131072}}) {
    const pid_t child = ::fork();
    if (child == 0) {
      std::signal(SIGXFSZ, SIG_IGN);
      const rlimit limit{bytes, bytes};
      ::setrlimit(RLIMIT_FSIZE, &limit);
      try {
        write(path, {volume}, 0.0, dated());
      } catch (const Error& error) {
        ::_exit(error.exit_code());
      } catch (...) {
        ::_exit(99);
      }
      ::_exit(0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 6) << bytes << ": " << status;
  }
  EXPECT_EQ(fs::file_size(path), 5U);
  fs::remove(path);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
