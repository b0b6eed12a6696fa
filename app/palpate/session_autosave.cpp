#include "session_autosave.hpp"

#include "palpate/session/session_file.hpp"

#include <QDir>
#include <QFile>
#include <QFileInfo>
#include <QLockFile>
#include <QUuid>

namespace palpate::gui {
namespace {

// A lost session that nobody wanted back for so long is of no use to anybody.
constexpr qint64 kept_days = 30;

QString ending() { return QString::fromLatin1(session::session_ending); }

QString lock_name(const QString& file) { return file + QStringLiteral(".lock"); }

// A lock never grows stale by its age: a window may be open for weeks.
std::unique_ptr<QLockFile> lock_of(const QString& file) {
  auto lock = std::make_unique<QLockFile>(lock_name(file));
  lock->setStaleLockTime(0);
  return lock;
}

}  // namespace

AutosaveFolder::AutosaveFolder(const QString& folder) : folder_(folder) {}

AutosaveFolder::~AutosaveFolder() = default;

QString AutosaveFolder::own_file() {
  if (!own_.isEmpty()) return own_;
  if (!QDir().mkpath(folder_)) return {};
  // Names of scans and users stay with those who may see them.
  QFile::setPermissions(folder_, QFileDevice::ReadOwner | QFileDevice::WriteOwner | QFileDevice::ExeOwner);
  const QString file = QDir(folder_).filePath(QUuid::createUuid().toString(QUuid::WithoutBraces) + ending());
  auto lock = lock_of(file);
  if (!lock->tryLock(0)) return {};
  own_lock_ = std::move(lock);
  own_ = file;
  return own_;
}

void AutosaveFolder::remove_own_file() {
  if (own_.isEmpty()) return;
  QFile::remove(own_);
  own_lock_.reset();
  own_.clear();
}

std::optional<LostSession> AutosaveFolder::take_lost() {
  clear_old();
  const auto files = QDir(folder_).entryInfoList({QLatin1Char('*') + ending()}, QDir::Files, QDir::Time);
  for (const QFileInfo& file : files) {
    if (file.absoluteFilePath() == own_) continue;
    auto lock = lock_of(file.absoluteFilePath());
    if (!lock->tryLock(0)) continue;  // its window lives
    if (!file.exists()) continue;
    lost_lock_ = std::move(lock);
    lost_ = file.absoluteFilePath();
    return LostSession{lost_, file.lastModified()};
  }
  return {};
}

void AutosaveFolder::remove_lost() {
  if (!lost_.isEmpty()) QFile::remove(lost_);
  release_lost();
}

void AutosaveFolder::release_lost() {
  lost_lock_.reset();
  lost_.clear();
}

void AutosaveFolder::clear_old() const {
  const QDateTime limit = QDateTime::currentDateTime().addDays(-kept_days);
  const auto entries =
      QDir(folder_).entryInfoList(QDir::Files | QDir::Dirs | QDir::Hidden | QDir::NoDotAndDotDot);
  for (const QFileInfo& entry : entries) {
    if (entry.lastModified() > limit) continue;
    if (entry.isDir()) {  // of a write that was cut off
      QDir(entry.absoluteFilePath()).removeRecursively();
    } else if (entry.fileName().endsWith(ending())) {
      auto lock = lock_of(entry.absoluteFilePath());
      if (lock->tryLock(0)) QFile::remove(entry.absoluteFilePath());
    }
  }
}

}  // namespace palpate::gui
