# Puts every kernels/*.cl into the program as text. Two uses of one file:
# included, it gives palpate_embed_kernels(target folder); run with -P, it
# writes the source file. A new or changed .cl makes it anew.
if(CMAKE_SCRIPT_MODE_FILE)
  set(table "")
  foreach(kernel IN LISTS KERNELS)
    get_filename_component(name "${kernel}" NAME)
    file(READ "${kernel}" text)
    string(APPEND table "    {\"${name}\", R\"OPENCL_C(${text})OPENCL_C\"},\n")
  endforeach()
  file(WRITE "${OUTPUT}" "// Made by cmake/EmbedKernels.cmake from kernels/*.cl.
#include \"embedded_kernels.hpp\"

#include <array>
#include <utility>

namespace palpate::compute {

std::string_view embedded_kernel(std::string_view file) noexcept {
  using Entry = std::pair<std::string_view, std::string_view>;
  static constexpr Entry kernels[] = {
${table}    {\"\", \"\"}};
  for (const auto& [name, text] : kernels)
    if (name == file) return text;
  return {};
}

}  // namespace palpate::compute
")
  return()
endif()

set(PALPATE_EMBED_SCRIPT "${CMAKE_CURRENT_LIST_FILE}")
function(palpate_embed_kernels target folder)
  file(GLOB kernels CONFIGURE_DEPENDS "${folder}/*.cl")
  set(output "${CMAKE_CURRENT_BINARY_DIR}/embedded_kernels.cpp")
  add_custom_command(OUTPUT "${output}"
    COMMAND "${CMAKE_COMMAND}" "-DKERNELS=${kernels}" "-DOUTPUT=${output}" -P "${PALPATE_EMBED_SCRIPT}"
    DEPENDS ${kernels} "${PALPATE_EMBED_SCRIPT}"
    COMMENT "Embedding the OpenCL kernels"
    VERBATIM)
  target_sources(${target} PRIVATE "${output}")
endfunction()
