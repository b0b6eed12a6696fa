#include "block.hpp"
#include "cases.hpp"

#include <cmath>

// Figures 10 and 11: what noise and stiffness make of a cube of 20 x 20 x 20
// points under the same force (thesis 4.2).
namespace palpate::evaluation {
namespace {

constexpr double thesis_stiffness_per_s2 = 10000.0;
constexpr double thesis_noise = 0.1;

int side_of(const Setup& setup) { return setup.quick ? 7 : 20; }

core::Progress part_of(const core::Progress& progress, std::size_t n, std::size_t count) {
  return progress.part(static_cast<double>(n) / static_cast<double>(count),
                       static_cast<double>(n + 1) / static_cast<double>(count));
}

}  // namespace

Result noise(const Setup& setup, const core::Progress& progress) {
  Result result;
  result.name = "noise";
  constexpr double force_mm_per_s2 = 200.0;
  const std::vector<double> amplitudes =
      setup.quick
          ? std::vector<double>{0.0, thesis_noise, 0.4}
          : std::vector<double>{0.0, 0.02, 0.05, thesis_noise, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5};
  Column deflection{"deflection", "mm", {}}, drift{"drift", "", {}}, links{"links a point", "", {}};
  std::shared_ptr<const model::Tissue> even, jittered;
  std::vector<Eigen::Vector3f> even_mm, jittered_mm;
  for (std::size_t n = 0; n < amplitudes.size(); ++n) {
    const auto part = part_of(progress, n, amplitudes.size());
    part.report(0.0, "Pushing cubes with noise");
    CubeModel model;
    model.side = side_of(setup);
    model.noise = amplitudes[n];
    Block block(setup, model, thesis_stiffness_per_s2);
    const Loaded loaded = block.push_sideways(force_mm_per_s2, part.cancel());
    deflection.values.push_back(loaded.deflection_mm);
    drift.values.push_back(loaded.drift);
    links.values.push_back(mean_links(*block.tissue()));
    if (amplitudes[n] == 0.0) {
      even = block.tissue();
      even_mm = loaded.positions_mm;
    } else if (amplitudes[n] == thesis_noise) {
      jittered = block.tissue();
      jittered_mm = loaded.positions_mm;
      result.findings = {
          {"without", "deflection without noise", deflection.values.front(), "mm"},
          {"with", "deflection with a noise of 0.1", loaded.deflection_mm, "mm"},
          {"ratio", "the one over the other", deflection.values.front() / loaded.deflection_mm, ""},
          {"links-without", "links a point without noise", links.values.front(), ""},
          {"links-with", "links a point with a noise of 0.1", links.values.back(), ""}};
    }
  }
  result.tables.push_back({result.name, {{"noise", "", amplitudes}, deflection, drift, links}});
  result.plots.push_back({result.name,
                          "Deflection under the same force, 12 nearest",
                          {"Noise (parts of the voxel spacing)", false, {}},
                          {"Deflection (mm)", true, {}},
                          {{"deflection", amplitudes, deflection.values, true, true, false, {}}}});
  result.shapes.push_back(side_by_side("noise-cubes", *even, even_mm, *jittered, jittered_mm));
  return result;
}

Result stiffness(const Setup& setup, const core::Progress& progress) {
  Result result;
  result.name = "stiffness";
  constexpr double force_mm_per_s2 = 10.0;
  constexpr double soft_per_s2 = 100.0;
  const std::vector<double> constants =
      setup.quick ? std::vector<double>{soft_per_s2, 1000.0, thesis_stiffness_per_s2}
                  : std::vector<double>{
                        soft_per_s2, 200.0,   500.0,   1000.0, 2000.0, 5000.0, thesis_stiffness_per_s2,
                        20000.0,     50000.0, 100000.0};
  Column deflection{"deflection", "mm", {}}, drift{"drift", "", {}};
  std::shared_ptr<const model::Tissue> tissue;
  std::vector<Eigen::Vector3f> soft_mm, stiff_mm;
  for (std::size_t n = 0; n < constants.size(); ++n) {
    const auto part = part_of(progress, n, constants.size());
    part.report(0.0, "Pushing cubes of several stiffnesses");
    CubeModel model;
    model.side = side_of(setup);
    Block block(setup, model, constants[n]);
    const Loaded loaded = block.push_sideways(force_mm_per_s2, part.cancel());
    deflection.values.push_back(loaded.deflection_mm);
    drift.values.push_back(loaded.drift);
    tissue = block.tissue();
    if (constants[n] == soft_per_s2) soft_mm = loaded.positions_mm;
    if (constants[n] == thesis_stiffness_per_s2) {
      stiff_mm = loaded.positions_mm;
      result.findings = {
          {"soft", "deflection at k = 100", deflection.values.front(), "mm"},
          {"stiff", "deflection at k = 10 000", loaded.deflection_mm, "mm"},
          {"ratio", "the one over the other", deflection.values.front() / loaded.deflection_mm, ""}};
    }
  }
  const std::size_t last = constants.size() - 1;
  result.findings.push_back({"slope",
                             "slope of log deflection over log k between the two stiffest; a spring gives -1",
                             std::log(deflection.values[last] / deflection.values[last - 1]) /
                                 std::log(constants[last] / constants[last - 1]),
                             ""});
  result.tables.push_back({result.name, {{"stiffness", "s^-2", constants}, deflection, drift}});
  result.plots.push_back({result.name,
                          "Deflection under the same force, noise 0.1, 12 nearest",
                          {"Spring constant k (s⁻²)", true, {}},
                          {"Deflection (mm)", true, {}},
                          {{"deflection", constants, deflection.values, true, true, false, {}}}});
  result.shapes.push_back(side_by_side("stiffness-cubes", *tissue, soft_mm, *tissue, stiff_mm));
  return result;
}

}  // namespace palpate::evaluation
