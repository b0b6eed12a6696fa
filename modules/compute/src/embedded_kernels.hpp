#pragma once

#include <string_view>

namespace palpate::compute {

/// The text of kernels/<file> as it was when the program was built; empty for an unknown file.
std::string_view embedded_kernel(std::string_view file) noexcept;

}  // namespace palpate::compute
