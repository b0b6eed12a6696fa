#include "scan_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return palpate::fuzzing::parse(data, size, "scan.mha", palpate::imaging::reading::parse_meta_image);
}
