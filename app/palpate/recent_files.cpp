#include "recent_files.hpp"

#include <QFileInfo>

namespace palpate::gui {
namespace {
const QString key = QStringLiteral("recent/paths");
}

RecentFiles::RecentFiles(QSettings& settings, QObject* parent) : QObject(parent), settings_(settings) {}

QStringList RecentFiles::paths() const {
  QStringList there;
  for (const QString& path : settings_.value(key).toStringList()) {
    if (QFileInfo::exists(path)) there << path;
  }
  return there.mid(0, most);
}

void RecentFiles::add(const QString& path) {
  QStringList list = settings_.value(key).toStringList();
  const QString absolute = QFileInfo(path).absoluteFilePath();
  list.removeAll(absolute);
  list.prepend(absolute);
  store(list.mid(0, most));
}

void RecentFiles::remove(const QString& path) {
  QStringList list = settings_.value(key).toStringList();
  list.removeAll(QFileInfo(path).absoluteFilePath());
  store(list);
}

void RecentFiles::clear() { store({}); }

void RecentFiles::store(const QStringList& paths) {
  settings_.setValue(key, paths);
  emit changed();
}

}  // namespace palpate::gui
