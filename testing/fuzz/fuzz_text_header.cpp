// Words, numbers, vectors, patterns and names of files out of a text header.
#include "reading/nrrd_header.hpp"
#include "reading/text_header.hpp"
#include "scan_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace palpate::imaging::reading;
  const std::string text(reinterpret_cast<const char*>(data), size);
  for (const auto& word : words_of(text)) {
    const auto value = number(word);
    const auto whole = whole_number(word);
    if (whole && value && std::abs(static_cast<double>(*whole) - *value) > 1e-6 * std::abs(*value) + 1.0)
      std::abort();
  }
  if (trimmed(text).size() > text.size()) std::abort();
  quoted_words(text);
  millimetres_in(text);
  seconds_in(text);
  const long long last = size == 0 ? 0 : data[0];
  const auto names = names_of_pattern(text, 0, last, 1);
  if (!names.empty() && names.size() != static_cast<std::size_t>(last + 1)) std::abort();
  try {
    nrrd_vectors(text, "scan.nrrd");
  } catch (const palpate::core::Error&) {
  }
  const auto header = palpate::fuzzing::folder() / "scan.mhd";
  std::ofstream(header, std::ios::binary) << "x";
  try {
    // Whatever is followed lies below the header's own folder.
    const auto data_file = companion(header, text);
    const auto inside = std::filesystem::canonical(palpate::fuzzing::folder()).string();
    if (data_file.string().compare(0, inside.size(), inside) != 0) std::abort();
  } catch (const palpate::core::Error&) {
  } catch (const std::filesystem::filesystem_error&) {
    std::abort();
  }
  return 0;
}
