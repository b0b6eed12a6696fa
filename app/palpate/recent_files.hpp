#pragma once

#include <QObject>
#include <QSettings>
#include <QStringList>

namespace palpate::gui {

/// The scans that were opened last, newest first; kept in the settings.
class RecentFiles : public QObject {
  Q_OBJECT

 public:
  static constexpr int most = 5;

  explicit RecentFiles(QSettings& settings, QObject* parent = nullptr);
  QStringList paths() const;
  void add(const QString& path);
  void remove(const QString& path);
  void clear();

 signals:
  void changed();

 private:
  void store(const QStringList& paths);
  QSettings& settings_;
};

}  // namespace palpate::gui
