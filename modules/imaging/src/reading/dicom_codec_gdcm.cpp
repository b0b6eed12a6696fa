#include "dicom_codec_gdcm.hpp"

#include <gdcmByteValue.h>
#include <gdcmFragment.h>
#include <gdcmJPEG2000Codec.h>
#include <gdcmJPEGCodec.h>
#include <gdcmSequenceOfFragments.h>

#include <algorithm>

namespace palpate::imaging::reading {
namespace {

template <typename Codec>
bool run(const std::vector<std::uint8_t>& stream, const FrameShape& shape, int precision, CodedFrame& frame) {
  gdcm::Fragment fragment;
  fragment.SetByteValue(reinterpret_cast<const char*>(stream.data()),
                        static_cast<gdcm::VL::Type>(stream.size()));
  const auto fragments = gdcm::SequenceOfFragments::New();
  fragments->AddFragment(fragment);
  gdcm::DataElement in(gdcm::Tag(0x7fe0, 0x0010));
  in.SetValue(*fragments);
  gdcm::DataElement out;
  Codec codec;
  const unsigned dims[3]{static_cast<unsigned>(frame.columns), static_cast<unsigned>(frame.rows), 1};
  codec.SetNumberOfDimensions(2);
  codec.SetDimensions(dims);
  const auto bits = static_cast<unsigned short>(8 * frame.sample_bytes);
  codec.SetPixelFormat(gdcm::PixelFormat(
      static_cast<unsigned short>(frame.samples), bits, static_cast<unsigned short>(precision),
      static_cast<unsigned short>(precision - 1), shape.is_signed ? 1 : 0));
  codec.SetPlanarConfiguration(0);
  codec.SetPhotometricInterpretation(frame.samples == 1 ? gdcm::PhotometricInterpretation::MONOCHROME2
                                                        : gdcm::PhotometricInterpretation::RGB);
  if (!codec.Decode(in, out)) return false;
  const gdcm::ByteValue* value = out.GetByteValue();
  if (value == nullptr || value->GetLength() < frame.bytes.size()) return false;
  std::copy_n(value->GetPointer(), frame.bytes.size(), reinterpret_cast<char*>(frame.bytes.data()));
  frame.planar = codec.GetPlanarConfiguration() == 1 && frame.samples > 1;
  return true;
}

}  // namespace

bool decode_by_gdcm(FrameCoding coding, const std::vector<std::uint8_t>& stream, const FrameShape& shape,
                    int precision, CodedFrame& frame) {
  switch (coding) {
    case FrameCoding::jpeg:
      return run<gdcm::JPEGCodec>(stream, shape, precision, frame);
    case FrameCoding::jpeg_2000:
      return run<gdcm::JPEG2000Codec>(stream, shape, precision, frame);
    default:
      return false;
  }
}

}  // namespace palpate::imaging::reading
