#include "writer_enhanced_us.hpp"

#include "dicom_values.hpp"

#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcmetinf.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dcsequen.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmdata/dcuid.h>
#include <fstream>
#include <initializer_list>
#include <memory>
#include <string>
#include <tuple>
#include <utility>

// What the standard requires and nobody here knows (the transducer, the focus,
// the acoustic output, the time of the acquisition) is written as "Unknown",
// zero or the year 1900, never as something that could be taken for a finding.

namespace palpate::imaging {
namespace {

namespace fs = std::filesystem;
using core::output_error;

constexpr const char* image_type = "DERIVED\\PRIMARY\\VOLUME\\NONE";

/// Which UID of the file a member of the hash is.
enum Member : std::uint64_t {
  study,
  series,
  instance,
  reference,
  volume_reference,
  synchronization,
  organization,
  source
};

void require(const OFCondition& condition) {
  if (condition.good()) return;
  throw core::Error(core::ErrorKind::internal, "dicom-failed",
                    "The DICOM library refused to make the file's header.", condition.text());
}

struct Code {
  const char* value;
  const char* scheme;
  const char* meaning;
};
constexpr Code unknown{"261665006", "SCT", "Unknown"};

/// A data set or an item of a sequence that is being filled.
class Item {
 public:
  explicit Item(DcmItem& item) : item_(item) {}

  void text(const DcmTagKey& tag, const std::string& value) const {
    require(item_.putAndInsertString(tag, value.c_str()));
  }
  void number(const DcmTagKey& tag, unsigned value) const {
    require(item_.putAndInsertUint16(tag, static_cast<Uint16>(value)));
  }
  void indices(const DcmTagKey& tag, const std::vector<Uint32>& values) const {
    require(item_.putAndInsertUint32Array(tag, values.data(), static_cast<unsigned long>(values.size())));
  }
  template <typename Values>
  void doubles(const DcmTagKey& tag, const Values& values) const {
    require(item_.putAndInsertFloat64Array(tag, values.data(), static_cast<unsigned long>(values.size())));
  }
  void real(const DcmTagKey& tag, double value) const { require(item_.putAndInsertFloat64(tag, value)); }
  void pointer(const DcmTagKey& tag, const DcmTagKey& to) const {
    require(item_.putAndInsertTagKey(tag, to));
  }
  void empty(const DcmTagKey& tag) const { require(item_.insertEmptyElement(tag)); }
  /// A new item at the end of a sequence.
  Item add(const DcmTagKey& sequence) const {
    DcmItem* added = nullptr;
    require(item_.findOrCreateSequenceItem(sequence, added, -2));
    return Item(*added);
  }
  void code(const DcmTagKey& sequence, const Code& code) const {
    const Item item = add(sequence);
    item.text(DCM_CodeValue, code.value);
    item.text(DCM_CodingSchemeDesignator, code.scheme);
    item.text(DCM_CodeMeaning, code.meaning);
  }

 private:
  DcmItem& item_;
};

/// All that the header is made from.
struct Content {
  const std::vector<core::Volume>& frames;
  const std::vector<double>& times_s;
  const DicomNotes& notes;
  StoredGreys greys;
  std::string date, time;  ///< of the content
  ContentHash hash;

  const core::ImageGeometry& geometry() const { return frames.front().geometry(); }
  std::size_t planes() const { return static_cast<std::size_t>(geometry().dims()[2]); }
};

ContentHash hash_of(const Content& content, const std::string& pixel_type) {
  ContentHash hash;
  for (const auto& frame : content.frames) hash.add(frame.data(), frame.size() * sizeof(float));
  hash.add(content.geometry().dims().data(), 3 * sizeof(int));
  hash.add(content.geometry().ijk_to_lps_mm().data(), 16 * sizeof(double));
  hash.add(content.times_s.data(), content.times_s.size() * sizeof(double));
  for (const auto& text : {content.notes.patient_name, content.notes.patient_id, content.notes.derivation,
                           content.date, content.time, pixel_type})
    hash.add(text.c_str(), text.size() + 1);
  hash.add(&content.notes.patient_axes, sizeof(bool));
  return hash;
}

void add_patient_and_study(const Item& set, const Content& content) {
  const auto& notes = content.notes;
  set.text(DCM_SpecificCharacterSet, "ISO_IR 192");
  set.text(DCM_SOPClassUID, UID_EnhancedUSVolumeStorage);
  set.text(DCM_SOPInstanceUID, content.hash.uid(instance));
  set.text(DCM_PatientName, notes.patient_name.empty() ? "ANONYMOUS" : notes.patient_name);
  set.text(DCM_PatientID, notes.patient_id);
  set.empty(DCM_PatientBirthDate);
  set.empty(DCM_PatientSex);
  set.text(DCM_StudyInstanceUID, content.hash.uid(study));
  for (const auto& tag : {DCM_StudyDate, DCM_StudyTime, DCM_ReferringPhysicianName, DCM_AccessionNumber})
    set.empty(tag);
  set.text(DCM_StudyID, "1");
  set.text(DCM_Modality, "US");
  set.text(DCM_SeriesInstanceUID, content.hash.uid(series));
  set.text(DCM_SeriesNumber, "1");
  set.empty(DCM_Laterality);
  set.text(DCM_Manufacturer, "Palpate");
  set.text(DCM_ManufacturerModelName, "Palpate");
  set.text(DCM_DeviceSerialNumber, "none");
  set.text(DCM_SoftwareVersions, PALPATE_VERSION);
}

void add_frames_of_reference(const Item& set, const Content& content) {
  set.text(DCM_FrameOfReferenceUID, content.hash.uid(reference));
  set.empty(DCM_PositionReferenceIndicator);
  set.text(DCM_SynchronizationFrameOfReferenceUID, content.hash.uid(synchronization));
  set.text(DCM_SynchronizationTrigger, "NO TRIGGER");
  set.text(DCM_AcquisitionTimeSynchronized, "N");
  set.text(DCM_VolumeFrameOfReferenceUID, content.hash.uid(volume_reference));
  // The terms are open (PS3.3 C.8.24.2): APEX would need an apex that nobody knows.
  set.text(DCM_UltrasoundAcquisitionGeometry, content.notes.patient_axes ? "PATIENT" : "UNKNOWN");
  if (content.notes.patient_axes) set.text(DCM_PatientFrameOfReferenceSource, "ESTIMATED");
  constexpr std::array<double, 16> same{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  set.doubles(DCM_VolumeToTransducerMappingMatrix, same);
}

void add_image(const Item& set, const Content& content) {
  const auto& geometry = content.geometry();
  set.text(DCM_InstanceNumber, "1");
  set.empty(DCM_PatientOrientation);
  set.text(DCM_ContentDate, content.date);
  set.text(DCM_ContentTime, content.time);
  set.text(DCM_NumberOfFrames, std::to_string(content.planes() * content.frames.size()));
  set.text(DCM_ImageType, image_type);
  set.text(DCM_AcquisitionDateTime, "19000101000000");
  set.real(DCM_AcquisitionDuration,
           content.times_s.empty() ? 0.0 : content.times_s.back() - content.times_s.front());
  set.text(DCM_PositionMeasuringDeviceUsed, "FREEHAND");
  set.text(DCM_LossyImageCompression, "00");
  set.text(DCM_PresentationLUTShape, "IDENTITY");
  set.text(DCM_RescaleIntercept, "0");
  set.text(DCM_RescaleSlope, "1");
  set.text(DCM_BurnedInAnnotation, "NO");
  const Item from = set.add(DCM_SourceImageSequence);
  // Required of a derived image. It stands for the scan without naming it.
  from.text(DCM_ReferencedSOPClassUID, UID_EnhancedUSVolumeStorage);
  from.text(DCM_ReferencedSOPInstanceUID, content.hash.uid(source));
  from.code(DCM_PurposeOfReferenceCodeSequence,
            {"121322", "DCM", "Source image for image processing operation"});
  set.code(DCM_ViewCodeSequence, unknown);
  set.code(DCM_AnatomicRegionSequence, {"123037004", "SCT", "Body structure"});
  set.code(DCM_TransducerScanPatternCodeSequence, {"125242", "DCM", "Volume scan pattern"});
  for (const auto& tag : {DCM_TransducerGeometryCodeSequence, DCM_TransducerBeamSteeringCodeSequence,
                          DCM_TransducerApplicationCodeSequence})
    set.code(tag, unknown);
  for (const auto& tag :
       {DCM_MechanicalIndex, DCM_BoneThermalIndex, DCM_CranialThermalIndex, DCM_SoftTissueThermalIndex})
    set.text(tag, "0");
  set.real(DCM_DepthsOfFocus, 0.0);
  const double depth_mm = geometry.spacing_mm()[1] * geometry.dims()[1];
  set.text(DCM_DepthOfScanField, std::to_string(std::lround(std::min(depth_mm, 1e6))));
  set.empty(DCM_AcquisitionContextSequence);

  set.number(DCM_SamplesPerPixel, 1);
  set.text(DCM_PhotometricInterpretation, "MONOCHROME2");
  set.number(DCM_Rows, static_cast<unsigned>(geometry.dims()[1]));
  set.number(DCM_Columns, static_cast<unsigned>(geometry.dims()[0]));
  const auto bits = static_cast<unsigned>(content.greys.bits);
  set.number(DCM_BitsAllocated, bits);
  set.number(DCM_BitsStored, bits);
  set.number(DCM_HighBit, bits - 1);
  set.number(DCM_PixelRepresentation, 0);
}

void add_dimensions(const Item& set, const Content& content) {
  const std::string uid = content.hash.uid(organization);
  set.text(DCM_DimensionOrganizationType, content.frames.size() > 1 ? "3D_TEMPORAL" : "3D");
  set.add(DCM_DimensionOrganizationSequence).text(DCM_DimensionOrganizationUID, uid);
  const auto dimension = [&](const DcmTagKey& attribute, const DcmTagKey& group, const char* label) {
    const Item item = set.add(DCM_DimensionIndexSequence);
    item.text(DCM_DimensionOrganizationUID, uid);
    item.pointer(DCM_DimensionIndexPointer, attribute);
    item.pointer(DCM_FunctionalGroupPointer, group);
    item.text(DCM_DimensionDescriptionLabel, label);
  };
  // These three in this order (PS3.3 C.8.24.3.3). Without known times the
  // frames are counted only.
  if (content.times_s.empty())
    dimension(DCM_TemporalPositionIndex, DCM_FrameContentSequence, "Time");
  else
    dimension(DCM_TemporalPositionTimeOffset, DCM_TemporalPositionSequence, "Time");
  dimension(DCM_ImagePositionVolume, DCM_PlanePositionVolumeSequence, "Plane");
  dimension(DCM_DataType, DCM_ImageDataTypeSequence, "Data");
}

/// The greys' values where the stored numbers are not themselves: the rescale
/// of this kind of image is fixed at one (PS3.3 C.8.24.3).
void add_real_world_values(const Item& shared, const StoredGreys& greys) {
  const Item map = shared.add(DCM_RealWorldValueMappingSequence);
  map.number(DCM_RealWorldValueFirstValueMapped, 0);
  map.number(DCM_RealWorldValueLastValueMapped, 65535);
  map.real(DCM_RealWorldValueIntercept, greys.intercept);
  map.real(DCM_RealWorldValueSlope, greys.slope);
  map.text(DCM_LUTExplanation, "Grey value");
  map.text(DCM_LUTLabel, "GREY");
  map.code(DCM_MeasurementUnitsCodeSequence, {"1", "UCUM", "no units"});
}

void add_shared_groups(const Item& set, const Content& content) {
  const auto& geometry = content.geometry();
  const Item shared = set.add(DCM_SharedFunctionalGroupsSequence);
  const Item measures = shared.add(DCM_PixelMeasuresSequence);
  const Eigen::Vector3d spacing = geometry.spacing_mm();
  // Between rows first, then between columns.
  measures.text(DCM_PixelSpacing, decimal_string(spacing[1]) + "\\" + decimal_string(spacing[0]));
  measures.text(DCM_SliceThickness, decimal_string(spacing[2]));
  measures.text(DCM_SpacingBetweenSlices, decimal_string(spacing[2]));

  Eigen::Matrix<double, 6, 1> orientation;
  orientation << geometry.direction().col(0), geometry.direction().col(1);
  shared.add(DCM_PlaneOrientationVolumeSequence).doubles(DCM_ImageOrientationVolume, orientation);
  if (content.notes.patient_axes)
    shared.add(DCM_PlaneOrientationSequence).text(DCM_ImageOrientationPatient, decimal_strings(orientation));

  const auto level = [&](float value) { return static_cast<double>(content.greys.number_of(value)); };
  double low = level(content.frames.front().range().min);
  double high = level(content.frames.front().range().max);
  for (const auto& frame : content.frames) {
    low = std::min(low, level(frame.range().min));
    high = std::max(high, level(frame.range().max));
  }
  const Item window = shared.add(DCM_FrameVOILUTSequence);
  window.text(DCM_WindowCenter, decimal_string((low + high) / 2.0));
  window.text(DCM_WindowWidth, decimal_string(std::max(high - low, 1.0)));
  if (content.greys.rescaled) add_real_world_values(shared, content.greys);

  const Item data = shared.add(DCM_ImageDataTypeSequence);
  data.text(DCM_DataType, "TISSUE_INTENSITY");
  data.text(DCM_AliasedDataType, "NO");
  const Item description = shared.add(DCM_USImageDescriptionSequence);
  description.text(DCM_FrameType, image_type);
  description.text(DCM_VolumetricProperties, "VOLUME");
  description.text(DCM_VolumeBasedCalculationTechnique, "NONE");
  if (content.notes.derivation.empty()) return;
  const Item derivation = shared.add(DCM_DerivationImageSequence);
  derivation.text(DCM_DerivationDescription, content.notes.derivation);
  derivation.code(DCM_DerivationCodeSequence, {"113087", "DCM", "Smoothing"});
  derivation.empty(DCM_SourceImageSequence);
}

void fill_plane(const Item& group, const Content& content, std::size_t frame, std::size_t plane) {
  const auto time = static_cast<Uint32>(frame + 1);
  const auto place = static_cast<Uint32>(plane + 1);
  const Item item = group.add(DCM_FrameContentSequence);
  item.indices(DCM_DimensionIndexValues, {time, place, 1});
  item.indices(DCM_TemporalPositionIndex, {time});
  item.text(DCM_StackID, "1");
  item.indices(DCM_InStackPositionNumber, {place});
  const Eigen::Vector3d position = content.geometry().to_lps_mm({0.0, 0.0, static_cast<double>(plane)});
  // The volume's frame of reference has the patient's axes and origin.
  group.add(DCM_PlanePositionVolumeSequence).doubles(DCM_ImagePositionVolume, position);
  if (content.notes.patient_axes)
    group.add(DCM_PlanePositionSequence).text(DCM_ImagePositionPatient, decimal_strings(position));
  if (!content.times_s.empty())
    group.add(DCM_TemporalPositionSequence).real(DCM_TemporalPositionTimeOffset, content.times_s[frame]);
}

void add_planes(DcmDataset& set, const Content& content, const core::Progress& progress,
                const std::string& what) {
  auto sequence = std::make_unique<DcmSequenceOfItems>(DCM_PerFrameFunctionalGroupsSequence);
  for (std::size_t frame = 0; frame < content.frames.size(); ++frame) {
    for (std::size_t plane = 0; plane < content.planes(); ++plane) {
      auto item = std::make_unique<DcmItem>();
      fill_plane(Item(*item), content, frame, plane);
      require(sequence->append(item.get()));
      item.release();  // the sequence owns it now
    }
    progress.report(0.3 * static_cast<double>(frame + 1) / static_cast<double>(content.frames.size()), what);
  }
  require(set.insert(sequence.get()));
  sequence.release();
}

/// The file's bytes up to the pixel data, made in memory: so each byte that
/// goes to the disk goes through one stream, whose failures are seen.
std::vector<char> header_bytes(DcmFileFormat& format) {
  constexpr auto syntax = EXS_LittleEndianExplicit;
  require(format.validateMetaInfo(syntax));
  const std::size_t room = format.calcElementLength(syntax, EET_ExplicitLength) + std::size_t{4096};
  std::vector<char> bytes(room);
  DcmOutputBufferStream stream(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  format.transferInit();
  const OFCondition written = format.write(stream, syntax, EET_ExplicitLength, nullptr, EGL_recalcGL);
  format.transferEnd();
  require(written);
  void* begin = nullptr;
  offile_off_t length = 0;
  stream.flushBuffer(begin, length);
  bytes.resize(static_cast<std::size_t>(length));
  return bytes;
}

/// Tag, representation and length of the pixel data (PS3.5 7.1.2).
std::array<char, 12> pixel_head(int bits, std::uint64_t bytes) {
  const auto octet = [&](unsigned n) { return static_cast<char>((bytes >> (8U * n)) & 0xFFU); };
  return {'\xE0', '\x7F', '\x10',   '\0',     'O',      bits == 8 ? 'B' : 'W',
          0,      0,      octet(0), octet(1), octet(2), octet(3)};
}

void write_pixels(std::ofstream& file, const Content& content, const core::Progress& progress,
                  const std::string& what) {
  const auto& geometry = content.geometry();
  const std::size_t plane =
      static_cast<std::size_t>(geometry.dims()[0]) * static_cast<std::size_t>(geometry.dims()[1]);
  std::vector<char> bytes;
  bytes.reserve(2 * plane);
  std::size_t done = 0;
  for (const auto& frame : content.frames)
    for (std::size_t k = 0; k < content.planes(); ++k) {
      bytes.clear();
      for (const float* value = frame.data() + k * plane; value != frame.data() + (k + 1) * plane; ++value) {
        const unsigned number = content.greys.number_of(*value);
        bytes.push_back(static_cast<char>(number & 0xFFU));
        if (content.greys.bits == 16) bytes.push_back(static_cast<char>(number >> 8U));
      }
      file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
      if (!file) return;
      ++done;
      progress.report(0.3 + 0.7 * static_cast<double>(done) /
                                static_cast<double>(content.planes() * content.frames.size()),
                      what);
    }
}

/// Refuses what the format cannot hold.
std::uint64_t pixel_bytes(const Content& content, const fs::path& target) {
  const auto& geometry = content.geometry();
  const Eigen::Matrix3d product = geometry.direction().transpose() * geometry.direction();
  // 1e-4 is 0.006 degrees, or 0.05 mm over a volume of 500 mm.
  if (!product.isApprox(Eigen::Matrix3d::Identity(), 1e-4))
    throw output_error(target, "oblique-axes",
                       "its axes are not at right angles, and a DICOM volume has no place for that; write "
                       ".mha or .nrrd");
  if (geometry.dims()[0] > 65535 || geometry.dims()[1] > 65535)
    throw output_error(target, "too-large", "a DICOM picture has at most 65535 rows and columns");
  const std::uint64_t bytes = static_cast<std::uint64_t>(geometry.voxel_count()) * content.frames.size() *
                              static_cast<std::uint64_t>(content.greys.bits / 8);
  if (bytes > 0xFFFFFFFEULL - 1)
    throw output_error(target, "too-large",
                       "a DICOM file holds at most 4 GB of voxels; write .mha or .nrrd, or fewer frames");
  return bytes;
}

std::pair<std::string, std::string> date_and_time(const std::string& stated) {
  if (stated.size() == 14 &&
      std::all_of(stated.begin(), stated.end(), [](char c) { return c >= '0' && c <= '9'; }))
    return {stated.substr(0, 8), stated.substr(8)};
  if (!stated.empty())
    core::throw_usage("The time of writing must be given as 14 digits, such as 20240131120000.");
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  localtime_r(&now, &parts);
  std::array<char, 16> text{};
  std::strftime(text.data(), text.size(), "%Y%m%d%H%M%S", &parts);
  const std::string whole(text.data());
  return {whole.substr(0, 8), whole.substr(8)};
}

}  // namespace

void write_enhanced_us_volume(const fs::path& staged, const fs::path& target,
                              const std::vector<core::Volume>& frames,
                              const std::vector<double>& frame_times_s, const WriteOptions& options,
                              const core::Progress& progress) {
  const std::string what = "Writing " + target.filename().string();
  Content content{frames, frame_times_s, options.dicom, {}, {}, {}, {}};
  if (options.pixel_type == "uint8")
    content.greys.bits = 8;
  else
    content.greys = stored_greys(frames);
  std::tie(content.date, content.time) = date_and_time(options.dicom.content_date_time);
  const std::uint64_t bytes = pixel_bytes(content, target);
  content.hash = hash_of(content, options.pixel_type);
  progress.report(0.1, what);

  DcmFileFormat format;
  DcmDataset& set = *format.getDataset();
  const Item top(set);
  add_patient_and_study(top, content);
  add_frames_of_reference(top, content);
  add_image(top, content);
  add_dimensions(top, content);
  add_shared_groups(top, content);
  add_planes(set, content, progress, what);
  const auto header = header_bytes(format);
  const auto head = pixel_head(content.greys.bits, bytes + bytes % 2);

  std::ofstream file(staged, std::ios::binary);
  file.write(header.data(), static_cast<std::streamsize>(header.size()));
  file.write(head.data(), head.size());
  write_pixels(file, content, progress, what);
  if (bytes % 2 != 0) file.put('\0');
  file.close();
  if (!file)
    throw output_error(
        target, "write-failed",
        "the disk took only a part of it; it may be full, or there is a limit on the size of files");
}

}  // namespace palpate::imaging
