#include "info_json.hpp"

#include "palpate/imaging/reader.hpp"

#include <cmath>
#include <stdexcept>

namespace palpate::imaging {
namespace reading {
namespace {

constexpr std::size_t longest_text = 2000;

std::string text_of(const nlohmann::json& json) {
  auto text = json.get<std::string>();
  if (text.size() > longest_text) throw std::invalid_argument("an over-long text");
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 && c != '\n') c = ' ';
  return text;
}

double finite(const nlohmann::json& json) {
  const auto value = json.get<double>();
  if (!std::isfinite(value)) throw std::invalid_argument("a number that is not finite");
  return value;
}

template <typename Vector>
nlohmann::json list_of(const Vector& vector) {
  return nlohmann::json{vector[0], vector[1], vector[2]};
}

int count_of(const nlohmann::json& json) {
  const auto value = json.get<long long>();
  if (value < 1 || value > (1LL << 31) - 1) throw std::invalid_argument("a count out of range");
  return static_cast<int>(value);
}

}  // namespace

nlohmann::json to_json(const core::VolumeInfo& info) {
  const core::ImageGeometry& geometry = info.geometry;
  nlohmann::json direction = nlohmann::json::array();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) direction.push_back(geometry.direction()(row, column));
  nlohmann::json spacing = nlohmann::json::array();
  for (const auto provenance : info.spacing_provenance) spacing.push_back(core::to_string(provenance));
  nlohmann::json warnings = nlohmann::json::array();
  for (const auto& warning : info.warnings)
    warnings.push_back({{"code", warning.code}, {"text", warning.text}});
  return {{"format", info.format},
          {"modality", info.modality},
          {"sop_class", info.sop_class},
          {"series_uid", info.series_uid},
          {"description", info.description},
          {"date", info.date},
          {"scanner", info.scanner},
          {"frames", info.frames},
          {"frame_times_s", info.frame_times_s},
          {"dims", geometry.dims()},
          {"spacing_mm", list_of(geometry.spacing_mm())},
          {"origin_mm", list_of(geometry.origin_mm())},
          {"direction", direction},
          {"components", info.components},
          {"pixel_type", info.pixel_type},
          {"min", info.min},
          {"max", info.max},
          {"mean", info.mean},
          {"provenance",
           {{"spacing", spacing},
            {"origin", core::to_string(info.origin_provenance)},
            {"direction", core::to_string(info.direction_provenance)},
            {"time", core::to_string(info.time_provenance)}}},
          {"patient_axes", info.patient_axes},
          {"orientation", info.orientation},
          {"orientation_choices", info.orientation_choices},
          {"warnings", warnings}};
}

core::VolumeInfo info_from_json(const nlohmann::json& json) {
  core::VolumeInfo info;
  info.format = text_of(json.at("format"));
  info.modality = text_of(json.at("modality"));
  info.sop_class = text_of(json.at("sop_class"));
  info.series_uid = text_of(json.at("series_uid"));
  info.description = text_of(json.at("description"));
  info.date = text_of(json.at("date"));
  info.scanner = text_of(json.at("scanner"));
  info.frames = count_of(json.at("frames"));
  const auto& times = json.at("frame_times_s");
  if (!times.empty() && times.size() != static_cast<std::size_t>(info.frames))
    throw std::invalid_argument("times that do not fit the frames");
  for (const auto& time : times) info.frame_times_s.push_back(finite(time));
  std::array<int, 3> dims{};
  Eigen::Vector3d spacing;
  Eigen::Vector3d origin;
  Eigen::Matrix3d direction;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    dims[axis] = count_of(json.at("dims").at(axis));
    spacing[static_cast<Eigen::Index>(axis)] = finite(json.at("spacing_mm").at(axis));
    origin[static_cast<Eigen::Index>(axis)] = finite(json.at("origin_mm").at(axis));
    info.spacing_provenance[axis] = core::provenance_from(json.at("provenance").at("spacing").at(axis));
    for (std::size_t column = 0; column < 3; ++column)
      direction(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(column)) =
          finite(json.at("direction").at(3 * axis + column));
  }
  info.geometry = core::ImageGeometry(dims, spacing, origin, direction);
  info.components = count_of(json.at("components"));
  info.pixel_type = text_of(json.at("pixel_type"));
  info.origin_provenance = core::provenance_from(json.at("provenance").at("origin"));
  info.direction_provenance = core::provenance_from(json.at("provenance").at("direction"));
  info.time_provenance = core::provenance_from(json.at("provenance").at("time"));
  info.patient_axes = json.at("patient_axes").get<bool>();
  info.orientation = text_of(json.at("orientation"));
  const auto& choices = json.at("orientation_choices");
  if (choices.size() > 48) throw std::invalid_argument("too many orientations");
  for (const auto& choice : choices) info.orientation_choices.push_back(text_of(choice));
  const auto& warnings = json.at("warnings");
  if (warnings.size() > 100) throw std::invalid_argument("too many warnings");
  for (const auto& warning : warnings)
    info.warnings.push_back({text_of(warning.at("code")), text_of(warning.at("text"))});
  return info;
}

}  // namespace reading

std::string volume_info_json(const core::VolumeInfo& info) {
  return reading::to_json(info).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace palpate::imaging
