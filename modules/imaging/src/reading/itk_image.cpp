#include "itk_image.hpp"

#include <regex>

namespace palpate::imaging::reading {

std::string plain_words(const std::string& itk_text) {
  static const std::regex noise(R"((itk::|ITK )?ERROR: |\w+\(0x[0-9a-f]+\): |\(0x[0-9a-f]+\))");
  std::string text = std::regex_replace(itk_text, noise, "");
  if (text.size() > 500) text.resize(500);
  return text;
}

}  // namespace palpate::imaging::reading
