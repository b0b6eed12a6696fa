// Mesh files; the first byte chooses the format. Those in XML are VTK's to parse.
#include "mesh_source.hpp"

#include "palpate/core/error.hpp"

#include <cstdint>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace palpate::surface;
  if (size == 0) return 0;
  const MeshSource source{"mesh", {reinterpret_cast<const char*>(data + 1), size - 1}};
  constexpr std::array<MeshContents (*)(const MeshSource&), 4> readers{read_stl, read_ply, read_obj,
                                                                       read_legacy_vtk};
  try {
    const MeshContents contents = readers[data[0] % readers.size()](source);
    for (const auto& triangle : contents.triangles)
      for (const auto corner : triangle)
        if (corner >= contents.vertices.size()) std::abort();
    if (!contents.intensities.empty() && contents.intensities.size() != contents.vertices.size())
      std::abort();
  } catch (const palpate::core::Error& error) {
    if (error.kind() == palpate::core::ErrorKind::internal) std::abort();
  }
  return 0;
}
