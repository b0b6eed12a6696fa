#pragma once

#include "job_tracker.hpp"
#include "session_autosave.hpp"
#include "workbench.hpp"

#include "palpate/session/session_file.hpp"

#include <QObject>
#include <QTimer>

#include <memory>
#include <optional>
#include <string>

namespace palpate::gui {

class ViewGrid;
class ViewState;

/// Why a session does not open by itself, to be asked about.
struct ScanQuestion {
  session::FoundInput::State state = session::FoundInput::State::missing;
  QString session;  ///< its file's name
  QString scan;     ///< the scan's file name
  QString place;    ///< the changed file, or where the scan was looked for first
};

/// The window's session: saves and opens it, keeps an autosave, and brings
/// back what was open when the program ended without being closed. The window
/// waits neither for writing nor for checksums.
class SessionKeeper : public QObject {
  Q_OBJECT

 public:
  SessionKeeper(Workbench& workbench, ViewState& state, ViewGrid& views, const QString& autosave_folder,
                QObject* parent);
  ~SessionKeeper() override;

  /// The scan is a file that can be found again.
  bool can_save() const;
  /// Where it was saved or opened; empty where it was neither.
  const QString& file() const { return file_; }
  /// For the file dialog: beside the scan, named after it.
  QString proposed_file() const;
  /// Since it was saved or opened. False where there is no file.
  bool changed() const { return changed_; }
  static bool is_session(const QString& path);

  void save(const QString& path);
  void open(const QString& path);
  /// An answer to scanUnclear: this scan, which need not be the one that was
  /// saved where `changed_too`.
  void open_with_scan(const QString& scan, bool changed_too);

  const std::optional<LostSession>& lost() const { return lost_; }
  void restore_lost();
  void discard_lost();
  /// The window closes: nothing is lost, so nothing is kept.
  void end();

 signals:
  void titleChanged();
  void saved(const QString& path);
  void opened();
  void scanUnclear(const palpate::gui::ScanQuestion& question);
  void problemFound(const palpate::gui::Problem& problem);

 private:
  struct Opening;
  void watch();
  void take_scan();
  void look_at_change();
  void autosave();
  void load(const QString& path, bool lost);
  void go_on(const session::FoundInput& found);
  void build(const session::FoundInput& found);
  void take_opened();
  session::Session session_now() const;
  std::string text_now() const;
  void fail(const core::Error& error);

  Workbench& workbench_;
  ViewState& state_;
  ViewGrid& views_;
  AutosaveFolder autosaves_;
  std::optional<LostSession> lost_;
  QString file_;
  bool changed_ = false;
  std::string saved_text_;      ///< what the file holds; empty: to be taken at the next look
  std::string autosaved_text_;  ///< what the autosave holds
  std::string checksum_;        ///< of the scan that is open; empty until it is made
  quint64 scans_ = 0;           ///< that were opened so far
  bool lost_is_back_ = false;   ///< it goes once this window's own autosave is written
  std::shared_ptr<Opening> opening_;
  QTimer look_delay_;
  QTimer autosave_delay_;
  // Last: their workers end before what they deliver to. A checksum has one of
  // its own, so that no autosave waits for that of a large folder.
  std::unique_ptr<JobTracker> checksums_, jobs_;
};

}  // namespace palpate::gui

Q_DECLARE_METATYPE(palpate::gui::ScanQuestion)
