// The part of the workbench that makes a whole session anew.
#include "opened_scan.hpp"
#include "stated_geometry.hpp"
#include "workbench.hpp"

#include "palpate/imaging/frame_store.hpp"

#include <utility>

namespace palpate::gui {
namespace {

/// All that a session is made into before the window sees any of it.
struct MadeSession {
  core::Volume filtered;
  std::optional<session::BuiltTissue> built;
  session::BoundSurface surface;
  std::vector<core::Warning> warnings;
};

core::Volume filtered_of(const core::Volume& volume, const session::Recipe& recipe,
                         const imaging::FilterOptions& options, const core::Progress& progress) {
  return recipe.filters.empty() ? volume
                                : session::filter_volume(volume, recipe.filters, options, progress).volume;
}

}  // namespace

void Workbench::open_session(const session::Session& session, std::function<void()> opened) {
  jobs_.start(
      JobLane::open, tr("Making the session anew"),
      [this, session, opened = std::move(opened), budget_bytes = frame_budget_bytes_,
       options = imaging::FilterOptions{device_.toStdString()}](
          const core::Progress& progress) -> JobTracker::Delivery {
        const auto& recipe = session.recipe;
        auto scan = std::make_shared<OpenedScan>();
        auto made = std::make_shared<MadeSession>();
        scan->input = recipe.input;
        session::Recipe noted = recipe;
        made->warnings = session::note_label_checksums(noted);
        const auto store = std::make_shared<imaging::FrameStore>(
            recipe.input.path, file_options(recipe.input), budget_bytes, progress.part(0.0, 0.3));
        scan->info = store->info();
        scan->frames = [store](int frame, const core::Progress& frame_progress) {
          return store->frame(frame, frame_progress);
        };
        const core::VolumeInfo info = restated(scan->info, recipe.input.spacing_mm, recipe.input.orientation);
        const auto frame_at = [&](int frame, const core::Progress& part) {
          return laid_out(store->frame(frame, part), info.geometry);
        };
        scan->volume = frame_at(recipe.input.frame, progress.part(0.3, 0.35));
        made->filtered = filtered_of(scan->volume, recipe, options, progress.part(0.35, 0.55));
        if (session.tissue_frame) {
          const int frame = *session.tissue_frame;
          const core::Volume source = frame == recipe.input.frame
                                          ? made->filtered
                                          : filtered_of(frame_at(frame, progress.part(0.55, 0.6)), recipe,
                                                        options, progress.part(0.6, 0.7));
          made->built = session::build_tissue(source, recipe, progress.part(0.7, 0.85));
          made->surface = session::build_surface(source, *made->built, recipe, progress.part(0.85, 1.0));
        }
        return [this, scan, made, session, opened] {
          // The scanner's remembered orientation has no say where a session states one.
          if (scan->input.orientation.empty()) scan->input.orientation = "file";
          take_scan(std::move(*scan));
          recipe_ = session.recipe;
          filtered_ = made->filtered;
          emit tissueParametersChanged();
          emit surfaceSourceChanged();
          emit simulationSettingsChanged();
          emit frameShown();
          if (!recipe_.filters.empty()) emit volumeFiltered();
          start_estimate();
          warn(made->warnings);
          if (made->built)
            take_tissue(std::move(*made->built), std::move(made->surface), *session.tissue_frame);
          if (opened) opened();
        };
      },
      [this](const core::Error& error) { fail(error); });
}

}  // namespace palpate::gui
