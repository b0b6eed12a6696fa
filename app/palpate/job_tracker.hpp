#pragma once

#include "palpate/core/error.hpp"
#include "palpate/core/progress.hpp"

#include <QObject>
#include <QString>
#include <QTimer>
#include <QVector>

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

namespace palpate::gui {

/// A job as the job bar shows it.
struct JobStatus {
  quint64 epoch = 0;
  QString title;        ///< "Reading sample-heart.mha"
  QString what;         ///< the hop's own words, or empty
  double fraction = 0;  ///< [0, 1]
  double elapsed_s = 0;
  bool running = false;  ///< else it waits for its turn
};

/// Jobs of one lane replace each other: a new one cancels those before it.
enum class JobLane { open, frame, filter, mask, estimate, tissue, anchors, picture, preview, devices };

/// Runs long work in one thread, in order. Each job has an epoch number; the
/// result of a job that was cancelled or replaced is dropped when it arrives,
/// however late. Results are delivered in the thread of the tracker.
class JobTracker : public QObject {
  Q_OBJECT

 public:
  /// What a finished job does in the tracker's thread.
  using Delivery = std::function<void()>;
  /// Runs in the worker; may throw core::Error.
  using Work = std::function<Delivery(const core::Progress&)>;
  using Failure = std::function<void(const core::Error&)>;

  explicit JobTracker(QObject* parent = nullptr);
  /// Cancels all and waits for the worker to come to its next stop.
  ~JobTracker() override;

  /// A job without a title is not listed: it says what it does elsewhere.
  quint64 start(JobLane lane, const QString& title, Work work, Failure failed);
  void cancel(quint64 epoch);
  void cancel_lane(JobLane lane);
  void cancel_all();
  bool busy(JobLane lane) const;
  /// Listed jobs, oldest first.
  QVector<JobStatus> jobs() const;

 signals:
  void jobsChanged();
  void jobCancelled(quint64 epoch);

 private:
  struct Job;
  void run();
  void deliver(const std::shared_ptr<Job>& job, const Delivery& delivery,
               const std::shared_ptr<core::Error>& error);

  std::deque<std::shared_ptr<Job>> current_;  // of the tracker's thread
  quint64 last_epoch_ = 0;
  QTimer ticker_;

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::shared_ptr<Job>> queue_;
  bool ending_ = false;
  std::thread worker_;
};

}  // namespace palpate::gui
