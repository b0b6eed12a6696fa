#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "scan_options.hpp"
#include "values.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/phantom.hpp"
#include "palpate/imaging/writer.hpp"
#include "palpate/surface/extract.hpp"

namespace palpate::cli {

int run_phantom(const Call& call) {
  CommonOptions common;
  imaging::PhantomParameters parameters;
  std::string output, surface_output, labels_output;
  OptionSet options("phantom", "phantom [options] -o OUT.mha",
                    "Makes the sample heart: a left ventricle of real size as ultrasound shows it, made up.");
  options.text("-o", "OUT.mha", "the file to write", output);
  options.value(
      "--size", "N", "voxels along the longest side, 16 to 512 (default 128)",
      [&](const std::string& text) { parameters.size = static_cast<int>(parse_whole(text, 16, 512)); });
  options.value(
      "--frames", "F", "frames of one heart beat, 1 to 64 (default 1)",
      [&](const std::string& text) { parameters.frames = static_cast<int>(parse_whole(text, 1, 64)); });
  options.value("--seed", "S", "of the speckle (default 1)",
                [&](const std::string& text) { parameters.seed = parse_seed(text); });
  options.text("--surface", "OUT.stl", "also writes the true surface of the wall", surface_output);
  options.text("--labels", "OUT.mha", "also writes labels: 1 wall, 2 cavity, 3 valve", labels_output);
  add_common(options, common);
  options.example("palpate-cli phantom -o heart.mha --size 96");
  if (parse_or_help(options, call)) return 0;
  if (output.empty()) core::throw_usage("phantom needs -o OUT.mha, the file to write.");
  check_output("-o", output, {".mha", ".mhd", ".nrrd", ".nii", ".nii.gz"});
  if (!surface_output.empty()) check_output("--surface", surface_output, {".stl", ".ply", ".obj", ".vtp"});
  if (!labels_output.empty())
    check_output("--labels", labels_output, {".mha", ".mhd", ".nrrd", ".nii", ".nii.gz"});
  check_apart({{"-o", output}, {"--surface", surface_output}, {"--labels", labels_output}});

  const auto progress = call.console.progress();
  const auto phantom = imaging::make_phantom(parameters, progress.part(0.0, 0.8));
  imaging::WriteOptions write_options;
  write_options.pixel_type = "uint8";
  imaging::write(output, phantom.frames, parameters.period_s / parameters.frames, write_options,
                 progress.part(0.8, 0.95));
  if (!surface_output.empty()) surface::save_mesh(surface_output, phantom.surface);
  if (!labels_output.empty())
    imaging::write(labels_output, {phantom.labels}, 0.0, write_options, progress.part(0.95, 1.0));

  const auto& first = phantom.frames.front();
  Json object;
  object["output"] = output;
  object["dims"] = first.dims();
  object["spacing_mm"] = list_of(first.geometry().spacing_mm());
  object["frames"] = phantom.frames.size();
  object["seed"] = parameters.seed;
  object["surface"] = surface_output.empty() ? Json(nullptr) : Json(surface_output);
  object["labels"] = labels_output.empty() ? Json(nullptr) : Json(labels_output);
  Table table;
  table.emplace_back("Voxels", std::to_string(first.dims()[0]) + " x " + std::to_string(first.dims()[1]) +
                                   " x " + std::to_string(first.dims()[2]));
  table.emplace_back("Spacing", shown(first.geometry().spacing_mm().x()) + " mm");
  table.emplace_back("Frames", std::to_string(phantom.frames.size()));
  call.console.result(object, "Wrote " + output, table);
  return 0;
}

}  // namespace palpate::cli
