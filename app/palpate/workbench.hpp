#pragma once

#include "filter_history.hpp"
#include "filter_preview.hpp"
#include "filtered_frames.hpp"
#include "frame_source.hpp"
#include "job_tracker.hpp"

#include "palpate/imaging/reader.hpp"
#include "palpate/session/pipeline.hpp"
#include "palpate/session/session_file.hpp"
#include "palpate/session/simulation_driver.hpp"
#include "palpate/visualization/picture.hpp"

#include <QElapsedTimer>
#include <QObject>
#include <QString>
#include <QStringList>
#include <QTimer>

#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <vector>

namespace palpate::gui {

/// What went wrong, as the message bar shows it.
struct Problem {
  enum class Offer { none, reference_device, other_device };
  bool warning = false;  ///< the work goes on
  QString text;          ///< one sentence for people
  QString code;
  QString details;
  Offer offer = Offer::none;
  QString other_device;  ///< its selector, where that is offered
  QString other_device_name;
};

class ScannerMemory;

/// Where a simulation can run.
struct DeviceChoice {
  QString selector;  ///< as compute::open_device takes it, or "reference"
  QString text;
};

/// What the step is held against: the limit of the state that is shown, or of
/// the tissue at rest until a device is ready.
struct StepLimit {
  double step_s = 0.0;
  std::uint32_t worst_point = 0;
  bool is_estimate = false;  ///< of the converged eigenvalue; else the quick bound
};

/// The session behind the window, without widgets: recipe, results of the
/// hops, the simulation. Hops run in the job tracker's worker, the simulation
/// in its driver's thread; signals carry what became of them.
class Workbench : public QObject {
  Q_OBJECT

 public:
  explicit Workbench(QObject* parent = nullptr);
  ~Workbench() override;

  JobTracker& jobs() { return jobs_; }
  const session::Recipe& recipe() const { return recipe_; }
  bool has_volume() const { return !volume_.empty(); }
  /// A volume that tissue can be made of: more than one voxel along each axis.
  bool has_depth() const {
    const auto& dims = volume_.dims();
    return has_volume() && dims[0] > 1 && dims[1] > 1 && dims[2] > 1;
  }
  bool has_tissue() const { return built_.has_value(); }
  bool is_filtered() const { return !recipe_.filters.empty() && has_volume(); }
  /// With what the user stated in the place of what the file says.
  const core::VolumeInfo& info() const { return info_; }
  const core::VolumeInfo& file_info() const { return file_info_; }
  const core::Volume& volume() const { return volume_; }
  const core::Volume& filtered() const { return filtered_; }
  const std::optional<session::Estimate>& estimate() const { return estimate_; }
  const std::optional<session::BuiltTissue>& tissue() const { return built_; }
  const session::BoundSurface& surface() const { return surface_; }
  const std::optional<session::Frame>& last_frame() const { return frame_; }
  bool playing() const { return frame_ && frame_->playing; }
  bool simulation_ready() const { return driver_ != nullptr && ready_; }
  /// The device was lost, or the simulation ended: its last state stays on the screen.
  bool simulation_stopped() const { return stopped_; }
  const QString& device() const { return device_; }
  /// Of the scan, for titles; a file's name, never what its header says.
  QString input_name() const;
  /// What the views draw now.
  visualization::SceneContent content() const;

  // Data
  void open(const QString& path, const std::string& series_uid = {});
  void open(const session::InputSettings& input);
  void open_sample(const QString& path);
  /// Makes all of it anew and swaps it in at the end, so that what fails costs
  /// nothing; `opened` is called when it stands. The scan is at its input's path.
  void open_session(const session::Session& session, std::function<void()> opened);
  /// Lays the voxels out anew, without reading them again; the tissue is dropped.
  void state_spacing(const std::optional<std::array<double, 3>>& spacing_mm);
  /// Three letters, or "file": as the file says. Remembered for the scanner
  /// where its files leave the orientation open.
  void state_orientation(const QString& orientation);
  /// Of orientations; may be null. It must outlive the workbench.
  void set_scanner_memory(ScannerMemory* memory) { scanner_memory_ = memory; }
  /// The orientation is the one remembered for the scanner.
  bool orientation_was_remembered() const { return remembered_; }
  // Time
  int frame() const { return recipe_.input.frame; }  ///< that is shown
  int frame_count() const { return has_volume() ? info_.frames : 0; }
  /// That was asked for last: the one that is shown, or one that is on its way.
  int wanted_frame() const { return wanted_frame_.value_or(frame()); }
  /// That the tissue was built from; -1 without tissue.
  int tissue_frame() const { return built_ ? tissue_frame_ : -1; }
  /// The filter chain was applied to the frame that is shown (or is empty).
  bool frame_is_filtered() const;
  /// Loads it in the background and shows it then; of several only the newest.
  void show_frame(int frame);
  /// While frames follow each other none is filtered that was not before.
  void set_scan_playing(bool playing);
  bool scan_playing() const { return scan_playing_; }
  /// Memory for the frames of a 4-D scan, from the next one that is opened.
  void set_frame_budget(std::size_t bytes) { frame_budget_bytes_ = bytes; }
  std::size_t frame_budget() const { return frame_budget_bytes_; }
  // Filter
  void apply_filters(const std::vector<imaging::FilterStep>& chain);
  /// Filters only the slices that are seen; what was applied ends it, and none.
  void preview_filters(const std::vector<imaging::FilterStep>& chain);
  FilterPreview& preview() { return preview_; }
  /// The views show the scan without filters for as long.
  void set_comparing(bool comparing);
  bool comparing() const { return comparing_; }
  /// Of the chain that was applied last; nothing without one.
  const std::optional<SpeckleChange>& speckle() const { return speckle_; }
  /// Memory for undone and earlier filters, from now on.
  void set_filter_history_budget(std::size_t bytes) { filter_history_.set_budget(bytes); }
  // Tissue
  void set_tissue_parameters(const model::TissueParameters& parameters);
  /// A file that was not read before is read first: one that does not fit costs
  /// nothing.
  void set_mask(const session::MaskSettings& mask);
  void set_face_budget(int faces);
  /// The surface is this mesh, or that of the scan where the path is empty.
  void set_surface_mesh(const QString& path, surface::MeshSpace space);
  void build_tissue();
  // Simulate
  /// Live, where there is a simulation. A label file of anchors is read first,
  /// as a mask is.
  void set_simulation(const session::SimulationSettings& settings);
  void set_device(const QString& selector);
  /// From the last state that was shown, after a device was lost.
  void go_on_with(const QString& selector);
  std::optional<StepLimit> step_limit() const;
  /// Marks the point that limits the step in the views.
  void show_limiting_point(bool shown);
  bool limiting_point_shown() const { return limit_shown_; }
  std::optional<Eigen::Vector3d> limiting_place_mm() const;
  void find_devices();
  void play();
  void pause();
  void step_once();
  void reset();
  /// The simulation's steps first, then the filters', which drop the tissue.
  void undo();
  void redo();
  bool can_undo() const;
  bool can_redo() const;
  bool undoes_filter() const { return !simulation_can_undo() && filter_history_.can_undo(); }
  bool redoes_filter() const { return !simulation_can_redo() && can_redo(); }
  void set_grab(double radius_mm, interaction::SelectionKind kind);
  double grab_radius_mm() const { return grab_radius_mm_; }
  interaction::SelectionKind grab_kind() const { return grab_kind_; }
  void grab(const interaction::Ray& ray, const interaction::PickReach& reach);
  void drag(const interaction::Ray& ray);
  void release();
  // Anchors
  /// Points that never move; null where there are none.
  const std::shared_ptr<const std::vector<std::uint32_t>>& anchors() const { return anchors_; }
  /// A stroke of the brush, which is one step of the undo.
  void begin_anchor_stroke(bool frees);
  void paint_anchors(const interaction::Ray& ray, const interaction::PickReach& reach);
  void end_anchor_stroke();
  void clear_painted_anchors();
  /// The brush takes anchors away, also without a key.
  void set_brush_frees(bool frees) { brush_frees_ = frees; }
  // Picture
  void save_picture(const QString& path, const visualization::ViewSettings& settings,
                    const visualization::PictureRequest& request);
  void preview_picture(const visualization::ViewSettings& settings,
                       const visualization::PictureRequest& request);

 signals:
  void volumeOpened();
  void geometryStated();  ///< the same voxels lie elsewhere
  void orientationRemembered(const QString& orientation);
  void frameWanted();
  void frameShown();
  void seriesFound(const QString& path, const std::vector<palpate::imaging::SeriesSummary>& series);
  void volumeFiltered();  ///< another chain's volume is there, by an undo too
  void filtersApplied();  ///< and this step is done
  void comparingChanged();
  void estimateStarted();
  void tissueEstimated();
  void estimateFailed(const QString& why);
  void tissueBuilt();
  void tissueDropped();
  void tissueParametersChanged();
  void surfaceSourceChanged();
  void simulationStarted();  ///< a driver was made; its device may still be prepared
  void simulationReady();
  void simulationSettingsChanged();
  void simulationStopped();
  void anchorsChanged();
  void limitShown();  ///< the mark of the limiting point came or went
  void frameArrived();
  void devicesFound(const QVector<palpate::gui::DeviceChoice>& devices);
  void pictureSaved(const QString& path);
  void previewDrawn(const palpate::core::Picture& picture);
  void previewFailed(const QString& why);
  void problemFound(const palpate::gui::Problem& problem);

 private:
  struct OpenedScan;
  /// What was painted before a step, and how many pulls lay before it.
  struct AnchorStep {
    std::vector<session::AnchorDab> painted;
    int pulls = 0;
  };
  void list_series(const session::InputSettings& input, const core::Error& why);
  void take_scan(OpenedScan scan);
  bool scan_memory_applies(const core::VolumeInfo& info, const std::string& orientation) const;
  void restate();
  void load_wanted_frame();
  void take_scan_frame(int frame, const core::Volume& volume);
  void rest_at_frame();
  void filter_frame();
  imaging::FilterOptions filter_options() const;
  AppliedFilters applied_filters() const;
  void take_filters(const AppliedFilters& applied, const std::vector<core::Warning>& warnings);
  void show_filters(const AppliedFilters& applied);
  void forget_filters();
  bool simulation_can_undo() const;
  bool simulation_can_redo() const;
  void drop_tissue();
  void take_tissue(session::BuiltTissue built, session::BoundSurface surface, int frame);
  void start_estimate();
  void run_estimate();
  void check_anchor_file(const session::AnchorSettings& anchors);
  void take_anchors(const session::AnchorSettings& anchors);
  void find_anchors();
  void lay_anchors();
  void put_anchor_step(std::vector<session::AnchorDab> before);
  bool anchors_undo_first() const;
  bool anchors_redo_first() const;
  void forget_anchors();
  void exchange_painted(std::vector<AnchorStep>& from, std::vector<AnchorStep>& to);
  void undo_simulation();
  void redo_simulation();
  void start_driver(std::optional<simulation::State> from = std::nullopt);
  void stop_driver();
  void retire_driver();
  void take_frame();
  void offer_way_on(Problem& problem);
  void on_event(quint64 epoch, const session::DriverEvent& event);
  void warn(const std::vector<core::Warning>& warnings);
  void fail(const core::Error& error);

  session::Recipe recipe_;
  core::VolumeInfo file_info_;
  core::VolumeInfo info_;
  FrameSource frames_;
  core::Volume volume_;
  core::Volume filtered_;
  std::optional<session::Estimate> estimate_;
  std::optional<session::BuiltTissue> built_;
  session::BoundSurface surface_;
  std::optional<session::Frame> frame_;
  QString device_;
  double grab_radius_mm_ = 6.0;
  /// Held firmly, the tissue stays with the hand; a soft grab lets it slip out behind.
  interaction::SelectionKind grab_kind_ = interaction::SelectionKind::connected;
  bool ready_ = false;
  bool stopped_ = false;
  bool limit_shown_ = false;
  QVector<DeviceChoice> devices_;
  std::vector<std::uint32_t> rule_anchors_;  ///< without what was painted
  std::shared_ptr<const std::vector<std::uint32_t>> anchors_;
  std::vector<AnchorStep> anchor_undo_;
  std::vector<AnchorStep> anchor_redo_;
  int pulls_ = 0;  ///< that the driver can undo
  std::optional<std::vector<session::AnchorDab>> stroke_before_;
  bool stroke_frees_ = false;
  bool brush_frees_ = false;
  ScannerMemory* scanner_memory_ = nullptr;
  bool remembered_ = false;
  std::size_t frame_budget_bytes_ = standard_frame_budget();
  std::optional<int> wanted_frame_;
  int tissue_frame_ = -1;
  bool scan_playing_ = false;
  FilteredFrames filtered_frames_;
  FilterHistory filter_history_;
  std::optional<SpeckleChange> speckle_;
  bool comparing_ = false;

  QTimer rest_delay_;
  QTimer estimate_delay_;
  QTimer frame_delay_;
  QElapsedTimer since_frame_;
  quint64 driver_epoch_ = 0;
  std::unique_ptr<session::SimulationDriver> driver_;
  std::vector<std::future<void>> retired_;  ///< drivers that end in threads of their own
  // Last: their workers end before what they deliver to. Frames have one of
  // their own, so that none waits behind a filter.
  JobTracker frame_jobs_;
  JobTracker jobs_;
  FilterPreview preview_;
};

}  // namespace palpate::gui

Q_DECLARE_METATYPE(palpate::gui::Problem)
