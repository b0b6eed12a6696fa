#include "palpate/testing/dicom_scans.hpp"

namespace palpate::testing {

void add_region(DicomNode dataset, const UsRegion& region) {
  const auto units = static_cast<std::uint16_t>(region.units);
  dataset.item({0x0018, 0x6011})
      .us({0x0018, 0x6012}, {static_cast<std::uint16_t>(region.spatial_format)})
      .us({0x0018, 0x6014}, {1})
      .ul({0x0018, 0x6018}, {0})
      .ul({0x0018, 0x601A}, {0})
      .ul({0x0018, 0x601C}, {1})
      .ul({0x0018, 0x601E}, {1})
      .us({0x0018, 0x6024}, {units})
      .us({0x0018, 0x6026}, {units})
      .fd({0x0018, 0x602C}, {region.x})
      .fd({0x0018, 0x602E}, {region.y});
}

void ClassicSlice::write(const std::filesystem::path& path) const {
  DicomMaker file(sop_class, modality, series, uid);
  file.top().text({0x0020, 0x0013}, uid);
  if (!position.empty()) file.top().text({0x0020, 0x0032}, position);
  if (!orientation.empty()) file.top().text({0x0020, 0x0037}, orientation);
  if (!spacing.empty()) file.top().text({0x0028, 0x0030}, spacing);
  for (const auto& [tag, text] : extra) file.top().text(tag, text);
  file.pixels(columns, rows, 0, bits, value);
  file.save(path);
}

namespace {

struct Frame {
  int slice = 0, time = 0;
  std::size_t type = 0, stack = 0;
};

std::string text_of(const Eigen::Vector3d& place) {
  return std::to_string(place[0]) + "\\" + std::to_string(place[1]) + "\\" + std::to_string(place[2]);
}

/// Dimensions in the order stack, time, place in the stack.
void add_dimensions(DicomNode top) {
  const std::string organization = "1.2.826.0.1.3680043.8.498.77.9";
  top.item({0x0020, 0x9221}).text({0x0020, 0x9164}, organization);
  for (const Tag tag : {Tag{0x0020, 0x9056}, Tag{0x0020, 0x9128}, Tag{0x0020, 0x9057}})
    top.item({0x0020, 0x9222})
        .text({0x0020, 0x9164}, organization)
        .attribute({0x0020, 0x9165}, tag)
        .attribute({0x0020, 0x9167}, {0x0020, 0x9111});
}

}  // namespace

void EnhancedScan::write(const std::filesystem::path& path) const {
  DicomMaker file(sop_class, modality, "7", "1");
  DicomNode top = file.top();
  if (sop_class == us_volume_class)
    top.text({0x0020, 0x9312}, "1.2.826.0.1.3680043.8.498.77.8").text({0x0020, 0x9307}, geometry);
  if (!patient_source.empty()) top.text({0x0020, 0x930C}, patient_source);
  add_dimensions(top);

  std::vector<Frame> frames;
  for (std::size_t stack = 0; stack < stacks.size(); ++stack)
    for (std::size_t type = 0; type < data_types.size(); ++type)
      for (std::size_t time = 0; time < times_s.size(); ++time)
        for (int slice = 0; slice < slices; ++slice)
          frames.push_back({slice, static_cast<int>(time), type, stack});
  if (!order.empty()) {
    std::vector<Frame> shuffled;
    for (const std::size_t n : order) shuffled.push_back(frames.at(n));
    frames = shuffled;
  }

  DicomNode shared = top.item({0x5200, 0x9229});
  shared.item({0x0028, 0x9110})
      .text({0x0028, 0x0030}, std::to_string(row_spacing) + "\\" + std::to_string(column_spacing))
      .text({0x0018, 0x0050}, "99");  // a thickness, which is no spacing
  const std::vector<double> cosines(axes.begin(), axes.end());
  if (volume_planes) shared.item({0x0020, 0x930F}).fd({0x0020, 0x9302}, cosines);
  if (patient_planes) {
    std::string words;
    for (const double cosine : cosines) words += (words.empty() ? "" : "\\") + std::to_string(cosine);
    shared.item({0x0020, 0x9116}).text({0x0020, 0x0037}, words);
  }
  for (const Frame& frame : frames) {
    DicomNode group = top.item({0x5200, 0x9230});
    const auto number = [](int from_zero) { return static_cast<std::uint32_t>(from_zero + 1); };
    DicomNode content = group.item({0x0020, 0x9111});
    content.ul({0x0020, 0x9157},
               {number(static_cast<int>(frame.stack)), number(frame.time), number(frame.slice)});
    if (!stacks[frame.stack].empty()) content.text({0x0020, 0x9056}, stacks[frame.stack]);
    content.ul({0x0020, 0x9128}, {number(frame.time)});
    // Stacks stand beside each other.
    const Eigen::Vector3d place =
        origin + step * frame.slice + step * (slices + 3.0) * static_cast<double>(frame.stack);
    if (volume_planes) group.item({0x0020, 0x930E}).fd({0x0020, 0x9301}, {place[0], place[1], place[2]});
    if (patient_planes) group.item({0x0020, 0x9113}).text({0x0020, 0x0032}, text_of(place));
    if (offsets_in_seconds)
      group.item({0x0020, 0x9310}).fd({0x0020, 0x930D}, {times_s[static_cast<std::size_t>(frame.time)]});
    if (!data_types[frame.type].empty())
      group.item({0x0018, 0x9807}).text({0x0018, 0x9808}, data_types[frame.type]);
  }
  file.pixels(columns, rows, static_cast<int>(frames.size()), 8, [&](int i, int j, int n) {
    const Frame& frame = frames[static_cast<std::size_t>(n)];
    return value(i, j, frame.slice, frame.time) + static_cast<int>(frame.type);
  });
  file.save(path);
}

}  // namespace palpate::testing
