#include "block.hpp"
#include "cases.hpp"

#include "palpate/core/error.hpp"

#include <cmath>
#include <limits>

// Section 3.1 of the thesis as figures: does a deformed model find back to its
// shape, and how stiff is it, against links and noise.
namespace palpate::evaluation {
namespace {

constexpr double stiffness_per_s2 = 10000.0;
constexpr double force_mm_per_s2 = 200.0;
constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

/// Medians over seeds.
struct Answer {
  double residual = nothing;  ///< of the drag
  double deflection_mm = nothing;
  double links = nothing;  ///< a point, on average
};

Answer ask(const Setup& setup, CubeModel model, const core::CancelToken& cancel) {
  model.side = setup.quick ? 6 : 10;
  std::vector<double> residuals, deflections, links;
  const bool is_random = model.noise > 0.0 || model.points != model::PointRule::lattice;
  const std::uint64_t seeds = is_random && !setup.quick ? 3 : 1;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    model.seed = seed;
    Block block(setup, model, stiffness_per_s2);
    deflections.push_back(block.push_sideways(force_mm_per_s2, cancel).deflection_mm);
    residuals.push_back(block.residual_after(0.3 * model.side, cancel));
    links.push_back(mean_links(*block.tissue()));
  }
  return {median(residuals), median(deflections), median(links)};
}

/// A kind of model along the axis of a figure.
struct Kind {
  std::string name;
  CubeModel model;
  Column residual, deflection, links;

  Kind(const std::string& kind, const CubeModel& cube)
      : name(kind),
        model(cube),
        residual{kind + " residual", "%", {}},
        deflection{kind + " deflection", "mm", {}},
        links{kind + " links a point", "", {}} {}
  void add(const Answer& answer) {
    residual.values.push_back(100.0 * answer.residual);
    deflection.values.push_back(answer.deflection_mm);
    links.values.push_back(answer.links);
  }
};

CubeModel cube_of(model::LinkRule links, int max_links, double noise,
                  model::PointRule points = model::PointRule::lattice) {
  CubeModel cube;
  cube.links = links;
  cube.max_links = max_links;
  cube.noise = noise;
  cube.points = points;
  return cube;
}

void add_figures(Result& result, const std::vector<Kind>& kinds, const Column& along, const Axis& x) {
  Table table{result.name, {along}};
  Plot residual{result.name,
                "What is left of a deformation after release",
                x,
                {"Residual (% of the drag)", false, {{-2.0, 102.0}}},
                {}};
  Plot deflection{result.name + "-deflection",
                  "Deflection under the same force",
                  x,
                  {"Deflection (mm)", true, {{0.08, 25.0}}},
                  {}};
  for (const auto& kind : kinds) {
    for (const auto* column : {&kind.residual, &kind.deflection, &kind.links})
      table.columns.push_back(*column);
    residual.series.push_back({kind.name, along.values, kind.residual.values, true, true, false, {}});
    deflection.series.push_back({kind.name, along.values, kind.deflection.values, true, true, false, {}});
  }
  result.tables.push_back(std::move(table));
  result.plots.push_back(std::move(residual));
  result.plots.push_back(std::move(deflection));
}

void add_finding(Result& result, const std::string& slug, const std::string& text, const Answer& answer) {
  result.findings.push_back({slug, "residual, " + text, 100.0 * answer.residual, "%"});
  result.findings.push_back({slug + "-deflection", "deflection, " + text, answer.deflection_mm, "mm"});
  result.findings.push_back({slug + "-links", "links a point, " + text, answer.links, ""});
}

}  // namespace

Result recovery_links(const Setup& setup, const core::Progress& progress) {
  using model::LinkRule;
  Result result;
  result.name = "recovery-links";
  const std::vector<double> numbers =
      setup.quick ? std::vector<double>{6, 12, 18}
                  : std::vector<double>{4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 22, 24};
  std::vector<Kind> kinds{{"noise 0.1", cube_of(LinkRule::nearest, 0, 0.1)},
                          {"no noise", cube_of(LinkRule::nearest, 0, 0.0)},
                          {"blue noise", cube_of(LinkRule::nearest, 0, 0.0, model::PointRule::blue_noise)}};
  for (std::size_t n = 0; n < numbers.size(); ++n) {
    const auto at = static_cast<double>(n) / static_cast<double>(numbers.size());
    for (auto& kind : kinds) {
      progress.report(0.9 * at, "Pulling cubes with " + std::to_string(std::lround(numbers[n])) + " links");
      kind.model.max_links = static_cast<int>(numbers[n]);
      kind.add(ask(setup, kind.model, progress.cancel()));
      if (numbers[n] == 12.0)
        result.findings.push_back({"nearest-12-" + std::to_string(&kind - kinds.data()),
                                   "residual, 12 nearest, " + kind.name, kind.residual.values.back(), "%"});
    }
  }
  add_figures(result, kinds, {"links asked for", "", numbers},
              {"Nearest points asked for, n", false, {{3.0, 27.0}}});
  const std::vector<std::pair<std::string, Kind>> fixed{
      {"six", {"six neighbours", cube_of(LinkRule::six, 6, 0.0)}},
      {"six-noise", {"six neighbours, noise 0.1", cube_of(LinkRule::six, 6, 0.1)}},
      {"lattice18", {"18 neighbours", cube_of(LinkRule::lattice18, 18, 0.0)}},
      {"lattice26", {"26 neighbours", cube_of(LinkRule::lattice26, 26, 0.0)}}};
  for (const auto& [slug, kind] : fixed) {
    progress.report(0.95, "Pulling cubes with " + kind.name);
    const Answer answer = ask(setup, kind.model, progress.cancel());
    add_finding(result, slug, kind.name, answer);
    const double x = kind.model.max_links;
    for (std::size_t plot = 0; plot < 2; ++plot)
      result.plots[plot].series.push_back({kind.name,
                                           {x},
                                           {plot == 0 ? 100.0 * answer.residual : answer.deflection_mm},
                                           false,
                                           true,
                                           false,
                                           {}});
  }
  return result;
}

Result recovery_noise(const Setup& setup, const core::Progress& progress) {
  using model::LinkRule;
  Result result;
  result.name = "recovery-noise";
  const std::vector<double> amplitudes =
      setup.quick ? std::vector<double>{0.0, 0.1, 0.4}
                  : std::vector<double>{0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5};
  std::vector<Kind> kinds{{"six neighbours", cube_of(LinkRule::six, 6, 0.0)},
                          {"8 nearest", cube_of(LinkRule::nearest, 8, 0.0)},
                          {"12 nearest", cube_of(LinkRule::nearest, 12, 0.0)},
                          {"18 nearest", cube_of(LinkRule::nearest, 18, 0.0)}};
  for (std::size_t n = 0; n < amplitudes.size(); ++n)
    for (auto& kind : kinds) {
      progress.report(static_cast<double>(n) / static_cast<double>(amplitudes.size()),
                      "Pulling cubes with noise");
      kind.model.noise = amplitudes[n];
      const Answer answer = ask(setup, kind.model, progress.cancel());
      kind.add(answer);
      if (kind.model.max_links == 12 || kind.model.max_links == 6)
        add_finding(result,
                    (kind.model.max_links == 6 ? "six-" : "nearest12-") +
                        std::to_string(std::lround(100.0 * amplitudes[n])),
                    kind.name + ", noise " + std::to_string(amplitudes[n]).substr(0, 4), answer);
    }
  add_figures(result, kinds, {"noise", "", amplitudes}, {"Noise (parts of the voxel spacing)", false, {}});
  return result;
}

}  // namespace palpate::evaluation
