#pragma once

#include "job_tracker.hpp"

#include "palpate/imaging/reader.hpp"
#include "palpate/session/pipeline.hpp"
#include "palpate/session/simulation_driver.hpp"
#include "palpate/visualization/picture.hpp"

#include <QElapsedTimer>
#include <QObject>
#include <QString>
#include <QStringList>
#include <QTimer>

#include <future>
#include <memory>
#include <optional>
#include <vector>

namespace palpate::gui {

/// What went wrong, as the message bar shows it.
struct Problem {
  enum class Offer { none, reference_device };
  bool warning = false;  ///< the work goes on
  QString text;          ///< one sentence for people
  QString code;
  QString details;
  Offer offer = Offer::none;
};

/// A series of a folder, to choose from.
struct SeriesChoice {
  QString uid;
  QString text;  ///< "US · 147 × 106 × 104 · 0.5 mm"; never a patient's name
};

/// Where a simulation can run.
struct DeviceChoice {
  QString selector;  ///< as compute::open_device takes it, or "reference"
  QString text;
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
  bool has_tissue() const { return built_.has_value(); }
  bool is_filtered() const { return !recipe_.filters.empty() && has_volume(); }
  const core::VolumeInfo& info() const { return info_; }
  const core::Volume& volume() const { return volume_; }
  const core::Volume& filtered() const { return filtered_; }
  const std::optional<session::Estimate>& estimate() const { return estimate_; }
  const std::optional<session::BuiltTissue>& tissue() const { return built_; }
  const session::BoundSurface& surface() const { return surface_; }
  const std::optional<session::Frame>& last_frame() const { return frame_; }
  bool playing() const { return frame_ && frame_->playing; }
  bool simulation_ready() const { return driver_ != nullptr && ready_; }
  const QString& device() const { return device_; }
  /// Of the scan, for titles; a file's name, never what its header says.
  QString input_name() const;
  /// What the views draw now.
  visualization::SceneContent content() const;

  // Data
  void open(const QString& path, const std::string& series_uid = {});
  void open_sample(const QString& path);
  /// Reads the present input again: another frame or a stated spacing.
  void reopen(int frame, const std::optional<std::array<double, 3>>& spacing_mm);
  // Filter
  void apply_filters(const std::vector<imaging::FilterStep>& chain);
  // Tissue
  void set_tissue_parameters(const model::TissueParameters& parameters);
  void set_face_budget(int faces);
  /// The surface is this mesh, or that of the scan where the path is empty.
  void set_surface_mesh(const QString& path, surface::MeshSpace space);
  void build_tissue();
  // Simulate
  void set_simulation(const session::SimulationSettings& settings);
  void set_device(const QString& selector);
  void find_devices();
  void play();
  void pause();
  void step_once();
  void reset();
  void undo();
  void redo();
  void set_grab(double radius_mm, interaction::SelectionKind kind);
  double grab_radius_mm() const { return grab_radius_mm_; }
  interaction::SelectionKind grab_kind() const { return grab_kind_; }
  void grab(const interaction::Ray& ray, const interaction::PickReach& reach);
  void drag(const interaction::Ray& ray);
  void release();
  // Picture
  void save_picture(const QString& path, const visualization::ViewSettings& settings,
                    const visualization::PictureRequest& request);
  void preview_picture(const visualization::ViewSettings& settings,
                       const visualization::PictureRequest& request);

 signals:
  void volumeOpened();
  void seriesFound(const QString& path, const QVector<palpate::gui::SeriesChoice>& series);
  void volumeFiltered();
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
  void frameArrived();
  void devicesFound(const QVector<palpate::gui::DeviceChoice>& devices);
  void pictureSaved(const QString& path);
  void previewDrawn(const palpate::core::Picture& picture);
  void previewFailed(const QString& why);
  void problemFound(const palpate::gui::Problem& problem);

 private:
  void read(const session::InputSettings& input, const QString& title);
  void list_series(const QString& path);
  void take_volume(core::VolumeSequence sequence, const session::InputSettings& input);
  void drop_tissue();
  void start_estimate();
  void run_estimate();
  void start_driver();
  void stop_driver();
  void retire_driver();
  void take_frame();
  void on_event(quint64 epoch, const session::DriverEvent& event);
  void fail(const core::Error& error);

  session::Recipe recipe_;
  core::VolumeInfo info_;
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

  QTimer estimate_delay_;
  QTimer frame_delay_;
  QElapsedTimer since_frame_;
  quint64 driver_epoch_ = 0;
  std::unique_ptr<session::SimulationDriver> driver_;
  std::vector<std::future<void>> retired_;  ///< drivers that end in threads of their own
  JobTracker jobs_;                         // last: its worker ends before what it delivers to
};

}  // namespace palpate::gui

Q_DECLARE_METATYPE(palpate::gui::Problem)
