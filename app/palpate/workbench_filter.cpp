// The part of the workbench that filters: applied chains, their undo, the preview.
#include "workbench.hpp"

#include <memory>
#include <utility>

namespace palpate::gui {

imaging::FilterOptions Workbench::filter_options() const { return {device_.toStdString()}; }

void Workbench::apply_filters(const std::vector<imaging::FilterStep>& chain) {
  if (!has_volume()) return;
  if (chain.empty()) {
    jobs_.cancel_lane(JobLane::filter);
    take_filters({chain, frame(), {}, std::nullopt}, {});
    return;
  }
  jobs_.start(
      JobLane::filter, tr("Filtering"),
      [this, source = volume_, chain, frame = this->frame(),
       options = filter_options()](const core::Progress& progress) -> JobTracker::Delivery {
        const auto filtered = session::filter_volume(source, chain, options, progress.part(0.0, 0.95));
        const SpeckleChange speckle{
            imaging::measure_speckle(source, progress.part(0.95, 0.975)),
            imaging::measure_speckle(filtered.volume, source, progress.part(0.975, 1.0))};
        // Another scan or geometry has cancelled this job; another frame is filtered in its turn.
        return [this, warnings = filtered.warnings,
                applied = AppliedFilters{chain, frame, filtered.volume, speckle}] {
          take_filters(applied, warnings);
        };
      },
      [this](const core::Error& error) { fail(error); });
}

// They were of another scan, or lie elsewhere now.
void Workbench::forget_filters() {
  filter_history_.clear();
  speckle_.reset();
  preview_.stop();
}

AppliedFilters Workbench::applied_filters() const {
  return {recipe_.filters, frame(),
          frame_is_filtered() && !recipe_.filters.empty() ? filtered_ : core::Volume{}, speckle_};
}

void Workbench::take_filters(const AppliedFilters& applied, const std::vector<core::Warning>& warnings) {
  if (!(applied.chain == recipe_.filters)) filter_history_.put(applied_filters());
  show_filters(applied);
  emit filtersApplied();
  warn(warnings);
}

void Workbench::show_filters(const AppliedFilters& applied) {
  preview_.stop();
  recipe_.filters = applied.chain;
  speckle_ = applied.speckle;
  const bool here = applied.frame == frame() && !applied.volume.empty();
  filtered_ = here ? applied.volume : volume_;
  drop_tissue();
  emit volumeFiltered();
  // Undone to a chain that was applied to another frame: this one is made now.
  if (!frame_is_filtered()) filter_frame();
  start_estimate();
}

bool Workbench::can_undo() const { return simulation_can_undo() || filter_history_.can_undo(); }
bool Workbench::can_redo() const {
  return simulation_can_redo() || (filter_history_.can_redo() && !simulation_can_undo());
}

// What was done last goes first: pulls lie after the filter that the tissue was
// made from. A filter that is undone takes the tissue with it.
void Workbench::undo() {
  if (simulation_can_undo()) {
    undo_simulation();
  } else if (filter_history_.can_undo()) {
    jobs_.cancel_lane(JobLane::filter);
    show_filters(filter_history_.undo(applied_filters()));
  }
}

void Workbench::redo() {
  if (simulation_can_redo()) {
    redo_simulation();
  } else if (can_redo()) {
    jobs_.cancel_lane(JobLane::filter);
    show_filters(filter_history_.redo(applied_filters()));
  }
}

void Workbench::preview_filters(const std::vector<imaging::FilterStep>& chain) {
  const bool shown_anyway = chain == recipe_.filters && frame_is_filtered();
  if (!has_volume() || chain.empty() || shown_anyway) {
    preview_.stop();
  } else {
    preview_.show(volume_, chain, filter_options());
  }
}

void Workbench::set_comparing(bool comparing) {
  if (comparing_ == comparing) return;
  comparing_ = comparing;
  emit comparingChanged();
}

}  // namespace palpate::gui
