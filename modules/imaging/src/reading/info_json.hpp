#pragma once

#include "palpate/core/volume.hpp"

#include <nlohmann/json.hpp>

namespace palpate::imaging::reading {

/// The VOLUME of docs/cli.md.
nlohmann::json to_json(const core::VolumeInfo& info);
/// What another process sent: every field is checked. Throws where it does not
/// fit the form: nlohmann's exceptions, std::invalid_argument or Error(input).
core::VolumeInfo info_from_json(const nlohmann::json& json);

}  // namespace palpate::imaging::reading
