#pragma once

#include "job_tracker.hpp"

#include "palpate/core/volume.hpp"
#include "palpate/imaging/filters.hpp"

#include <QObject>
#include <QString>
#include <QTimer>

#include <array>
#include <optional>
#include <vector>

namespace palpate::gui {

/// Filters the slices that are seen while parameters change: in a thread of
/// its own, a moment after the last change, and only those slices. What was
/// shown stays until the next is there.
class FilterPreview : public QObject {
  Q_OBJECT

 public:
  explicit FilterPreview(QObject* parent = nullptr);

  void show(const core::Volume& source, const std::vector<imaging::FilterStep>& chain,
            const imaging::FilterOptions& options);
  void stop();
  bool active() const { return !chain_.empty(); }
  const std::vector<imaging::FilterStep>& chain() const { return chain_; }
  /// A view shows this slice across this axis of the image, or none.
  void want(int axis, std::optional<int> index);
  /// The slice as it was filtered last; nothing where it was not yet.
  std::optional<core::Volume> slice(int axis, int index) const;
  /// All that is wanted was filtered as the chain is now.
  bool settled() const;

 signals:
  void changed();
  void failed(const QString& why);

 private:
  struct Slice {
    int index = 0;
    core::Volume volume;
    bool fresh = false;  ///< of the chain and source as they are
  };
  bool missing(int axis) const;
  void wait();
  void run();

  core::Volume source_;
  std::vector<imaging::FilterStep> chain_;
  imaging::FilterOptions options_;
  std::array<std::optional<int>, 3> wanted_;
  std::array<std::optional<Slice>, 3> made_;
  QTimer delay_;
  JobTracker jobs_;  // last: its worker ends before what it delivers to
};

}  // namespace palpate::gui
