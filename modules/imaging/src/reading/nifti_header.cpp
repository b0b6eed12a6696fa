#include "nifti_header.hpp"

#include "parsed.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace palpate::imaging::reading {
namespace {

constexpr std::size_t first_bytes = 348;
constexpr std::size_t second_bytes = 540;

/// Numbers at places of a block of bytes, in either order.
class Fields {
 public:
  Fields(const std::string& bytes, bool big_endian)
      : bytes_(bytes), swapped_(big_endian != (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__)) {}
  template <typename T>
  T at(std::size_t place) const {
    std::array<char, sizeof(T)> raw{};
    std::memcpy(raw.data(), bytes_.data() + place, sizeof(T));
    if (swapped_) std::reverse(raw.begin(), raw.end());
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }

 private:
  const std::string& bytes_;
  bool swapped_;
};

void take_first(const Fields& fields, NiftiHeader& header) {
  for (std::size_t n = 0; n < 8; ++n) {
    header.dim[n] = fields.at<std::int16_t>(40 + 2 * n);
    header.pixdim[n] = static_cast<double>(fields.at<float>(76 + 4 * n));
  }
  header.intent_code = fields.at<std::int16_t>(68);
  header.datatype = fields.at<std::int16_t>(70);
  header.bitpix = fields.at<std::int16_t>(72);
  header.vox_offset = static_cast<double>(fields.at<float>(108));
  header.scl_slope = static_cast<double>(fields.at<float>(112));
  header.scl_inter = static_cast<double>(fields.at<float>(116));
  header.xyzt_units = fields.at<std::uint8_t>(123);
  header.qform_code = fields.at<std::int16_t>(252);
  header.sform_code = fields.at<std::int16_t>(254);
  for (std::size_t n = 0; n < 3; ++n) {
    header.quatern[n] = static_cast<double>(fields.at<float>(256 + 4 * n));
    header.qoffset[static_cast<Eigen::Index>(n)] = static_cast<double>(fields.at<float>(268 + 4 * n));
    for (std::size_t column = 0; column < 4; ++column)
      header.srow(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(column)) =
          static_cast<double>(fields.at<float>(280 + 16 * n + 4 * column));
  }
}

void take_second(const Fields& fields, NiftiHeader& header) {
  for (std::size_t n = 0; n < 8; ++n) {
    header.dim[n] = fields.at<std::int64_t>(16 + 8 * n);
    header.pixdim[n] = fields.at<double>(104 + 8 * n);
  }
  header.datatype = fields.at<std::int16_t>(12);
  header.bitpix = fields.at<std::int16_t>(14);
  header.vox_offset = static_cast<double>(fields.at<std::int64_t>(168));
  header.scl_slope = fields.at<double>(176);
  header.scl_inter = fields.at<double>(184);
  header.qform_code = fields.at<std::int32_t>(344);
  header.sform_code = fields.at<std::int32_t>(348);
  for (std::size_t n = 0; n < 3; ++n) {
    header.quatern[n] = fields.at<double>(352 + 8 * n);
    header.qoffset[static_cast<Eigen::Index>(n)] = fields.at<double>(376 + 8 * n);
    for (std::size_t column = 0; column < 4; ++column)
      header.srow(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(column)) =
          fields.at<double>(400 + 32 * n + 8 * column);
  }
  header.xyzt_units = fields.at<std::int32_t>(500);
  header.intent_code = fields.at<std::int32_t>(504);
}

}  // namespace

NiftiHeader nifti_header_of(const std::string& bytes, const std::filesystem::path& path) {
  if (bytes.size() < first_bytes)
    fail("truncated", path, "is shorter than a NIfTI header. Copy or export it again.");
  NiftiHeader header;
  const auto length_of = [&](bool big_endian) { return Fields(bytes, big_endian).at<std::int32_t>(0); };
  for (const bool big_endian : {false, true})
    for (const auto& [length, version] : {std::pair<std::size_t, int>(first_bytes, 1), {second_bytes, 2}})
      if (length_of(big_endian) == static_cast<std::int32_t>(length)) {
        header.version = version;
        header.big_endian = big_endian;
        const std::size_t magic_at = version == 1 ? 344 : 4;
        const std::string magic = bytes.substr(magic_at, 3);
        const std::string digit = std::to_string(version);
        if (magic != "n+" + digit && magic != "ni" + digit)
          fail("unsupported", path, "is an Analyze file or a damaged NIfTI file. Export NIfTI (.nii).");
        if (bytes.size() < length)
          fail("truncated", path, "is shorter than a NIfTI-2 header. Copy or export it again.");
        header.single_file = magic[1] == '+';
        const Fields fields(bytes, big_endian);
        if (version == 1)
          take_first(fields, header);
        else
          take_second(fields, header);
        return header;
      }
  fail("bad-header", path, "does not begin like a NIfTI file.");
}

Eigen::Matrix<double, 3, 4> qform_of(const NiftiHeader& header, const Eigen::Vector3d& spacing) {
  const auto [b, c, d] = header.quatern;
  const double rest = 1.0 - (b * b + c * c + d * d);
  // Rounding may leave a length a little over one; then a half turn is meant.
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(rest > 1e-7 ? std::sqrt(rest) : 0.0, b, c, d).normalized();
  Eigen::Vector3d scale = spacing;
  if (header.pixdim[0] < 0.0) scale[2] = -scale[2];
  Eigen::Matrix<double, 3, 4> matrix;
  matrix.leftCols<3>() = turn.toRotationMatrix() * scale.asDiagonal();
  matrix.col(3) = header.qoffset;
  return matrix;
}

}  // namespace palpate::imaging::reading
