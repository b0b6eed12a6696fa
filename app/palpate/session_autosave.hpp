#pragma once

#include <QDateTime>
#include <QString>

#include <memory>
#include <optional>

class QLockFile;

namespace palpate::gui {

/// A session that a program left behind when it ended without being closed.
struct LostSession {
  QString path;
  QDateTime when;  ///< it was last written
};

/// The folder of autosaves. Each window has a file of its own there, held by a
/// lock, so that no window overwrites another's, and that a file without a
/// living owner is known as lost.
class AutosaveFolder {
 public:
  explicit AutosaveFolder(const QString& folder);
  ~AutosaveFolder();

  /// This window's file; the folder and the lock are made by the first call.
  /// Empty where they cannot be made.
  QString own_file();
  void remove_own_file();
  /// The newest lost one. It is this window's from now on: no other offers it.
  std::optional<LostSession> take_lost();
  void remove_lost();
  /// Leaves it for the next start.
  void release_lost();

 private:
  void clear_old() const;

  QString folder_;
  QString own_;
  QString lost_;
  std::unique_ptr<QLockFile> own_lock_, lost_lock_;
};

}  // namespace palpate::gui
