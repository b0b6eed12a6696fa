// Volumes in vendors' own tags: what is decoded, and what is refused.
#include "vendor.hpp"

#include "../orientation.hpp"
#include "../settle.hpp"
#include "../text_header.hpp"

#include <algorithm>
#include <cmath>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdatset.h>
#include <dcmtk/dcmdata/dcelem.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcstack.h>
#include <sstream>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;

constexpr double mm_a_cm = 10.0;
constexpr double centimetres = 3.0;  // of (0018,6024) and its like
constexpr const char* cine_class = "1.2.840.10008.5.1.4.1.1.3.1";
constexpr const char* movie_group = "GEMS_Ultrasound_MovieGroup_001";

std::string sop_class_of(const DicomItem& dataset) { return dataset.text({0x0008, 0x0016}); }

std::vector<double> private_numbers(const DicomItem& item, std::uint16_t group, const std::string& creator,
                                    std::uint8_t low) {
  const auto tag = item.private_tag(group, creator, low);
  if (!tag) return {};
  auto values = item.numbers(*tag);
  if (!values.empty()) return values;
  // Numbers in a text type.
  std::string rest = item.text(*tag);
  while (!rest.empty()) {
    const auto end = rest.find('\\');
    const auto value = reading::number(trimmed(rest.substr(0, end)));
    if (!value || !std::isfinite(*value)) return {};
    values.push_back(*value);
    rest = end == std::string::npos ? "" : rest.substr(end + 1);
  }
  return values;
}

int count_in(const DicomItem& dataset, DicomTag tag, int otherwise) {
  const auto found = dataset.number(tag);
  return found && *found >= 1.0 && *found < 1e6 ? static_cast<int>(*found) : otherwise;
}

[[noreturn]] void lacks(const DicomFile& file, const std::string& kind, const std::string& what) {
  fail("unsupported", file.path(),
       "is " + kind + " (SOP class " + sop_class_of(file.dataset()) + ", scanner " +
           scanner_of(file.dataset()) + ") but lacks " + what +
           ". Nothing was guessed. Export it again, or as Enhanced US Volume, MetaImage or NRRD.");
}

void set_axis(VendorGrid& grid, int axis, double mm, Provenance provenance) {
  if (!is_voxel_size(mm)) return;
  grid.spacing_mm[axis] = mm;
  grid.spacing_provenance[static_cast<std::size_t>(axis)] = provenance;
}

/// The number of slices. Where the file does not say its type the bytes may
/// read as several numbers; the one that the voxels' length bears out is it.
int qlab_slices(const DicomFile& file, double voxels_a_slice, const std::vector<double>& said,
                const std::vector<std::uint8_t>& bytes) {
  std::vector<double> possible = said;
  if (bytes.size() == 4)
    possible.push_back(bytes[0] + 256.0 * (bytes[1] + 256.0 * (bytes[2] + 256.0 * bytes[3])));
  if (bytes.size() >= 2) possible.push_back(bytes[0] + 256.0 * bytes[1]);
  possible.erase(std::remove_if(possible.begin(), possible.end(),
                                [](double count) { return !(count >= 1.0) || count > 1e5; }),
                 possible.end());
  const auto length = static_cast<double>(file.pixels().value.length);
  for (const double count : possible)
    if (length - voxels_a_slice * count <= 1.0 && length >= voxels_a_slice * count)
      return static_cast<int>(count);
  return possible.empty() ? 0 : static_cast<int>(possible.front());
}

std::optional<VendorGrid> qlab_grid(const DicomFile& file) {
  const DicomItem dataset = file.dataset();
  if (sop_class_of(dataset) != "1.2.840.113543.6.6.1.3.10002") return std::nullopt;
  const std::string creator = "Philips3D";
  const std::string kind = "a Philips QLAB Cartesian volume";
  constexpr std::uint16_t group = 0x3001;
  if (dataset.number({0x0028, 0x0100}).value_or(0.0) != 8.0 || file.pixels().encapsulated)
    lacks(file, kind, "plain voxels of 8 bits");
  VendorGrid grid;
  grid.kind = "Philips QLAB Cartesian";
  grid.raw_slices = true;
  grid.dims = {count_in(dataset, {0x0028, 0x0011}, 0), count_in(dataset, {0x0028, 0x0010}, 0), 1};
  if (grid.dims[0] < 1 || grid.dims[1] < 1) lacks(file, kind, "its rows and columns");
  grid.frames = count_in(dataset, {0x0028, 0x0008}, 1);
  const auto tag = dataset.private_tag(group, creator, 0x01);
  grid.dims[2] = qlab_slices(file, 1.0 * grid.dims[0] * grid.dims[1] * grid.frames,
                             private_numbers(dataset, group, creator, 0x01),
                             tag ? dataset.bytes(*tag) : std::vector<std::uint8_t>{});
  if (grid.dims[2] < 1) lacks(file, kind, "its number of slices (creator Philips3D)");
  // The size of a pixel stands beside the regions, or in the first of them.
  std::vector<DicomItem> places{dataset};
  for (const auto& region : dataset.items({0x0018, 0x6011})) places.push_back(region);
  for (const auto& place : places) {
    const auto in_cm = [&](DicomTag unit) { return place.number(unit).value_or(0.0) == centimetres; };
    if (!place.has({0x0018, 0x602C}) || !in_cm({0x0018, 0x6024}) || !in_cm({0x0018, 0x6026})) continue;
    set_axis(grid, 0, std::abs(place.number({0x0018, 0x602C}).value_or(0.0)) * mm_a_cm, Provenance::stated);
    set_axis(grid, 1, std::abs(place.number({0x0018, 0x602E}).value_or(0.0)) * mm_a_cm, Provenance::stated);
    break;
  }
  const auto across = private_numbers(dataset, group, creator, 0x03);
  const auto unit = private_numbers(dataset, group, creator, 0x02);
  if (!across.empty() && (unit.empty() || unit[0] == centimetres))
    set_axis(grid, 2, std::abs(across[0]) * mm_a_cm, Provenance::private_tag);
  // Identity in RAS; in LPS with the slices reversed; diag(-1, 1, -1) in LPS.
  grid.orientations = {"RAS", "LPI", "RPI"};
  grid.times = cine_times(dataset, grid.frames);
  return grid;
}

/// Frames are slices; a time point holds `slices` of them where that divides them.
void take_slices(VendorGrid& grid, const DicomItem& dataset, int slices) {
  const int frames = count_in(dataset, {0x0028, 0x0008}, 1);
  const bool sequence = slices > 1 && slices < frames && frames % slices == 0;
  grid.dims = {count_in(dataset, {0x0028, 0x0011}, 1), count_in(dataset, {0x0028, 0x0010}, 1),
               sequence ? slices : frames};
  grid.frames = sequence ? frames / slices : 1;
}

std::optional<VendorGrid> affinity_grid(const DicomFile& file) {
  const DicomItem dataset = file.dataset();
  if (sop_class_of(dataset) != cine_class) return std::nullopt;
  const std::string creator = "Philips US Imaging DD 036";
  constexpr std::uint16_t group = 0x200D;
  const auto spacing = private_numbers(dataset, group, creator, 0x03);
  if (spacing.size() != 3 || !std::all_of(spacing.begin(), spacing.end(), is_voxel_size)) return std::nullopt;
  const auto dims = private_numbers(dataset, group, creator, 0x01);
  VendorGrid grid;
  grid.kind = "Philips Affinity";
  take_slices(grid, dataset, dims.size() == 3 ? static_cast<int>(std::clamp(dims[2], 0.0, 1e6)) : 0);
  for (int axis = 0; axis < 3; ++axis)
    set_axis(grid, axis, spacing[static_cast<std::size_t>(axis)], Provenance::private_tag);
  grid.orientations = {"LPS", "RAS", "LPI", "RPI"};
  return grid;
}

std::optional<VendorGrid> artemis_grid(const DicomFile& file) {
  const DicomItem dataset = file.dataset();
  if (sop_class_of(dataset) != cine_class || lower_case(dataset.text({0x0008, 0x0070})) != "eigen" ||
      lower_case(dataset.text({0x0008, 0x1090})) != "artemis")
    return std::nullopt;
  VendorGrid grid;
  grid.kind = "Eigen Artemis";
  take_slices(grid, dataset, 0);
  std::vector<double> own;
  for (const char* creator : {"Eigen, Inc", "Eigen Artemis"})
    if (own.empty()) own = private_numbers(dataset, 0x1129, creator, 0x16);
  // The maker's rule: the aspect ratio counts microns of all three axes. A
  // ratio of 1 to 1 is the standard's meaning of the tag and no size.
  constexpr double microns_a_mm = 1000.0;
  const auto ratio = dataset.numbers({0x0028, 0x0034});
  const bool microns = !ratio.empty() && ratio[0] >= 10.0;
  for (int axis = 0; axis < 3; ++axis) {
    if (microns)
      set_axis(grid, axis, ratio[0] / microns_a_mm, Provenance::private_tag);
    else if (!own.empty())
      set_axis(grid, axis, own[0], Provenance::private_tag);
  }
  if (microns && !own.empty() && std::abs(own[0] * microns_a_mm / ratio[0] - 1.0) > 0.01) {
    std::ostringstream text;
    text << "The pixel aspect ratio says voxels of " << ratio[0] / microns_a_mm << " mm, the private tag "
         << own[0] << " mm; the first was taken.";
    grid.warnings.push_back({"spacing-conflict", text.str()});
  }
  // The origin is the volume's centre.
  grid.origin_mm = Eigen::Vector3d(1 - grid.dims[0], 1 - grid.dims[1], 1 - grid.dims[2]) * 0.5;
  *grid.origin_mm = grid.origin_mm->cwiseProduct(grid.spacing_mm);
  // What the maker says, and what a common viewer does with the same file.
  grid.orientations = {"LPS", "ILA", "RAS"};
  return grid;
}

/// The kind of data in GE's group: "Trace+3D" and the like; empty where none.
std::string movie_kind(const DicomItem& dataset) {
  constexpr std::uint16_t group = 0x7FE1;
  const auto root = dataset.private_tag(group, movie_group, 0x01);
  if (!root) return {};
  std::string kinds = "raw";
  for (const auto& item : dataset.items(*root))
    if (const auto tag = item.private_tag(group, movie_group, 0x02)) kinds += "+" + item.text(*tag);
  return kinds;
}

/// What private elements at any depth hold together.
struct PrivateData {
  std::size_t bytes = 0;    ///< of the largest binary value
  std::string creator;      ///< whose it is
  std::string says_volume;  ///< a private text that speaks of 3-D or 4-D data
};

PrivateData private_data_in(const DicomFile& file) {
  PrivateData found;
  DcmStack stack;
  DcmDataset& dataset = *file.format().getDataset();
  while (dataset.nextObject(stack, OFTrue).good()) {
    DcmObject* object = stack.top();
    const DcmTag& tag = object->getTag();
    if (tag.getGroup() % 2 == 0 || object->ident() == EVR_item || object->ident() == EVR_SQ) continue;
    const std::size_t length = object->getLengthField();
    const bool binary = object->getVR() == EVR_OB || object->getVR() == EVR_OW || object->getVR() == EVR_UN;
    constexpr std::size_t short_text = 256;
    if (binary && length != DCM_UndefinedLength && length > found.bytes) {
      found.bytes = length;
      const char* creator = tag.getPrivateCreator();
      found.creator = creator == nullptr ? "unknown creator" : creator;
    } else if (length < short_text && tag.getElement() > 0xFF && object->isLeaf()) {
      OFString text;
      if (static_cast<DcmElement*>(object)->getOFString(text, 0).bad()) continue;
      const std::string words(text.c_str());
      if (words.find("3D") != std::string::npos || words.find("4D") != std::string::npos)
        found.says_volume = words;
    }
  }
  return found;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "none" : text;
}

}  // namespace

std::optional<VendorGrid> vendor_grid(const DicomFile& file) {
  if (auto grid = qlab_grid(file)) return grid;
  if (auto grid = affinity_grid(file)) return grid;
  return artemis_grid(file);
}

std::string scanner_of(const DicomItem& dataset) {
  const std::string maker = dataset.text({0x0008, 0x0070});
  const std::string model = dataset.text({0x0008, 0x1090});
  if (maker.empty() || lower_case(model).find(lower_case(maker)) != std::string::npos) return model;
  return model.empty() ? maker : maker + " " + model;
}

std::string unread_volume(const DicomFile& file) {
  const PrivateData found = private_data_in(file);
  constexpr std::size_t megabyte = std::size_t{1} << 20;
  const std::string kind = movie_kind(file.dataset());
  const bool movie = kind.find("3D") != std::string::npos || kind.find("4D") != std::string::npos;
  if (!movie && (found.bytes < megabyte || found.says_volume.empty())) return {};
  return "The file also holds what seems to be a volume in the maker's private form (" +
         (movie ? std::string(movie_group) + ", " + kind : found.creator + ", " + found.says_volume) +
         "), which is not published and was left; what is shown is the picture beside it. Export the volume "
         "as Cartesian DICOM or Enhanced US Volume from the scanner or its workstation.";
}

void refuse_private_only(const DicomFile& file) {
  const DicomItem dataset = file.dataset();
  const auto creators = dataset.creators();
  if (file.pixels().kind != DicomPixelPlace::Kind::none || creators.empty()) return;
  const std::string modality = dataset.text({0x0008, 0x0060});
  const bool movie = !movie_kind(dataset).empty();
  // Reports and the like carry private tags too, and no picture is missed in them.
  if (!movie && modality != "US" && modality != "IVUS") return;
  const std::string what = movie ? "GE's raw ultrasound data (" + movie_kind(dataset) + ")"
                                 : std::string("data of a private form");
  std::string scanner = scanner_of(dataset);
  if (scanner.empty()) scanner = "unknown";
  fail("unsupported", file.path(),
       "holds its scan only as " + what + ", whose form is not published (SOP class " +
           sop_class_of(dataset) + ", scanner " + scanner + ", private creators " + joined(creators) +
           "): pixels in a standard form and the place of the beams are missing. Nothing was guessed. Export "
           "the scan from the vendor's workstation as Cartesian DICOM, Enhanced US Volume or MetaImage, or "
           "as a 2-D clip.",
       "SOP class: " + sop_class_of(dataset) + "\nModality: " + modality + "\nScanner: " + scanner +
           "\nSoftware: " + dataset.text({0x0018, 0x1020}) + "\nTransfer syntax: " + file.transfer_syntax() +
           "\nPrivate creators: " + joined(creators));
}

void say_orientation(const std::string& kind, const ReadOptions& options, core::VolumeInfo& info) {
  if (orientation_given(options) || info.orientation_choices.empty()) return;
  std::string others;
  for (std::size_t n = 1; n < info.orientation_choices.size(); ++n)
    others += (n == 1                                     ? ""
               : n + 1 == info.orientation_choices.size() ? " or "
                                                          : ", ") +
              info.orientation_choices[n];
  warn(info, "orientation-ambiguous",
       kind + " does not say how the volume lies in the patient. i, j and k were taken to point to " +
           info.orientation_choices.front() + "; " + others +
           " are in use as well. Choose with --orientation, or in the data panel.");
}

}  // namespace palpate::imaging::reading
