// What a reader process that a file has taken over may send.
#include "reading/info_json.hpp"

#include "palpate/core/error.hpp"

#include <cstdint>
#include <cstdlib>
#include <stdexcept>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace palpate::imaging::reading;
  const auto json = nlohmann::json::parse(data, data + size, nullptr, false);
  if (json.is_discarded()) return 0;
  try {
    const auto info = info_from_json(json);
    if (!info.geometry.ijk_to_lps_mm().allFinite()) std::abort();
    // What was accepted is told again in the same words.
    const auto told = to_json(info);
    if (to_json(info_from_json(told)) != told) std::abort();
  } catch (const nlohmann::json::exception&) {
  } catch (const std::invalid_argument&) {
  } catch (const palpate::core::Error& error) {
    if (error.kind() == palpate::core::ErrorKind::internal) std::abort();
  }
  return 0;
}
