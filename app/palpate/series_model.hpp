#pragma once

#include "palpate/imaging/reader.hpp"

#include <QAbstractItemModel>
#include <QIcon>

#include <optional>
#include <vector>

namespace palpate::gui {

/// The series of a folder in groups of a study's date and scanner. What will
/// not open as a volume is disabled and says why. Never a patient's name.
class SeriesModel : public QAbstractItemModel {
  Q_OBJECT

 public:
  enum Column {
    name_column,
    modality_column,
    size_column,
    frames_column,
    spacing_column,
    date_column,
    files_column,
    column_count
  };
  /// What a column is sorted by.
  static constexpr int sort_role = Qt::UserRole;

  explicit SeriesModel(std::vector<imaging::SeriesSummary> series, QObject* parent = nullptr);

  /// Null for a group.
  const imaging::SeriesSummary* series_at(const QModelIndex& index) const;
  bool opens(const QModelIndex& index) const;

  QModelIndex index(int row, int column, const QModelIndex& parent = {}) const override;
  QModelIndex parent(const QModelIndex& child) const override;
  int rowCount(const QModelIndex& parent = {}) const override;
  int columnCount(const QModelIndex& parent = {}) const override;
  QVariant data(const QModelIndex& index, int role = Qt::DisplayRole) const override;
  QVariant headerData(int section, Qt::Orientation orientation, int role) const override;
  Qt::ItemFlags flags(const QModelIndex& index) const override;

 private:
  struct Group {
    QString title;
    std::vector<std::size_t> series;
  };
  QVariant text_of(const imaging::SeriesSummary& series, int column) const;
  QVariant sort_key(const imaging::SeriesSummary& series, int column) const;

  std::vector<imaging::SeriesSummary> series_;
  std::vector<QIcon> thumbnails_;
  std::vector<Group> groups_;
};

}  // namespace palpate::gui
