#include "series_model.hpp"

#include "text.hpp"

#include <QFont>
#include <QImage>
#include <QPainter>

#include <algorithm>
#include <map>

namespace palpate::gui {
namespace {

constexpr int thumbnail_px = 64;
constexpr quintptr no_group = 0;  // a group's own index; a series holds its group plus one

QString group_title(const core::VolumeInfo& info) {
  QStringList parts;
  parts << (info.date.empty() ? SeriesModel::tr("Date not known") : QString::fromStdString(info.date));
  if (!info.scanner.empty()) parts << QString::fromStdString(info.scanner);
  return parts.join(QStringLiteral(" · "));
}

QString name_of(const imaging::SeriesSummary& series) {
  const QString description = QString::fromStdString(series.info.description).simplified();
  if (!description.isEmpty()) return description;
  // DICOM names its files in ways that may hold a patient's name.
  if (!series.info.series_uid.empty() || series.info.format == "DICOM")
    return SeriesModel::tr("No description");
  return QString::fromStdString(series.path.filename().string());
}

// On a ground of its own, so that the rows are level; a line that is chosen
// does not tint it.
QIcon thumbnail_of(const core::Picture& picture) {
  if (picture.width_px <= 0 || picture.height_px <= 0) return {};
  const QImage image(picture.rgba.data(), picture.width_px, picture.height_px, 4 * picture.width_px,
                     QImage::Format_RGBA8888);
  const QImage small =
      image.scaled(thumbnail_px, thumbnail_px, Qt::KeepAspectRatio, Qt::SmoothTransformation);
  QPixmap ground(thumbnail_px, thumbnail_px);
  ground.fill(Qt::black);
  QPainter painter(&ground);
  painter.drawImage((thumbnail_px - small.width()) / 2, (thumbnail_px - small.height()) / 2, small);
  painter.end();
  QIcon icon(ground);
  for (const auto mode : {QIcon::Selected, QIcon::Disabled}) icon.addPixmap(ground, mode);
  return icon;
}

}  // namespace

SeriesModel::SeriesModel(std::vector<imaging::SeriesSummary> series, QObject* parent)
    : QAbstractItemModel(parent), series_(std::move(series)) {
  std::map<QString, std::size_t> known;
  for (std::size_t n = 0; n < series_.size(); ++n) {
    thumbnails_.push_back(thumbnail_of(series_[n].thumbnail));
    const QString title = group_title(series_[n].info);
    const auto [found, is_new] = known.emplace(title, groups_.size());
    if (is_new) groups_.push_back({title, {}});
    groups_[found->second].series.push_back(n);
  }
}

const imaging::SeriesSummary* SeriesModel::series_at(const QModelIndex& index) const {
  if (!index.isValid() || index.internalId() == no_group) return nullptr;
  const auto& group = groups_[static_cast<std::size_t>(index.internalId()) - 1];
  return &series_[group.series[static_cast<std::size_t>(index.row())]];
}

bool SeriesModel::opens(const QModelIndex& index) const {
  const auto* series = series_at(index);
  return series != nullptr && series->error_code.empty();
}

QModelIndex SeriesModel::index(int row, int column, const QModelIndex& parent) const {
  if (!hasIndex(row, column, parent)) return {};
  if (!parent.isValid()) return createIndex(row, column, no_group);
  return createIndex(row, column, static_cast<quintptr>(parent.row()) + 1);
}

QModelIndex SeriesModel::parent(const QModelIndex& child) const {
  if (!child.isValid() || child.internalId() == no_group) return {};
  return createIndex(static_cast<int>(child.internalId()) - 1, 0, no_group);
}

int SeriesModel::rowCount(const QModelIndex& parent) const {
  if (!parent.isValid()) return static_cast<int>(groups_.size());
  if (parent.internalId() != no_group || parent.column() > 0) return 0;
  return static_cast<int>(groups_[static_cast<std::size_t>(parent.row())].series.size());
}

int SeriesModel::columnCount(const QModelIndex&) const { return column_count; }

QVariant SeriesModel::text_of(const imaging::SeriesSummary& series, int column) const {
  const auto& info = series.info;
  const bool sized = info.geometry.voxel_count() > 1;
  switch (column) {
    case name_column: {
      const QString name = name_of(series);
      return series.error_text.empty() ? name
                                       : name + QLatin1Char('\n') + QString::fromStdString(series.error_text);
    }
    case modality_column:
      return QString::fromStdString(info.modality.empty() ? info.format : info.modality);
    case size_column:
      return sized ? describe_dims(info.geometry) : QStringLiteral("–");
    case frames_column:
      return sized ? QString::number(info.frames) : QStringLiteral("–");
    case spacing_column:
      return sized ? describe_spacing(info) : QStringLiteral("–");
    case date_column:
      return info.date.empty() ? QStringLiteral("–") : QString::fromStdString(info.date);
    case files_column:
      return QString::number(series.files);
    default:
      return {};
  }
}

QVariant SeriesModel::sort_key(const imaging::SeriesSummary& series, int column) const {
  const auto& info = series.info;
  switch (column) {
    case size_column:
      return static_cast<qulonglong>(info.geometry.voxel_count());
    case frames_column:
      return info.frames;
    case spacing_column:
      return info.spacing_is_assumed() ? 1e9 : info.geometry.spacing_mm().minCoeff();
    case files_column:
      return static_cast<qulonglong>(series.files);
    default:
      return text_of(series, column);
  }
}

QVariant SeriesModel::data(const QModelIndex& index, int role) const {
  if (!index.isValid()) return {};
  const auto* series = series_at(index);
  if (series == nullptr) {
    const auto& group = groups_[static_cast<std::size_t>(index.row())];
    if (index.column() != name_column) return {};
    if (role == Qt::DisplayRole || role == sort_role || role == Qt::AccessibleTextRole) return group.title;
    if (role == Qt::FontRole) {
      QFont bold;
      bold.setWeight(QFont::DemiBold);
      return bold;
    }
    return {};
  }
  switch (role) {
    case Qt::DisplayRole:
      return text_of(*series, index.column());
    case sort_role:
      return sort_key(*series, index.column());
    case Qt::DecorationRole:
      if (index.column() == name_column) {
        const auto& thumbnail =
            thumbnails_[groups_[index.internalId() - 1].series[static_cast<std::size_t>(index.row())]];
        if (!thumbnail.isNull()) return thumbnail;
      }
      return {};
    case Qt::ToolTipRole:
      if (!series->error_text.empty()) return QString::fromStdString(series->error_text);
      return index.column() == spacing_column
                 ? QVariant(describe_spacing_provenance(series->info))
                 : QVariant(tr("%1, double click opens it").arg(name_of(*series)));
    case Qt::AccessibleTextRole:
      return text_of(*series, index.column());
    case Qt::TextAlignmentRole:
      if (index.column() == frames_column || index.column() == files_column)
        return static_cast<int>(Qt::AlignCenter);
      return {};
    default:
      return {};
  }
}

QVariant SeriesModel::headerData(int section, Qt::Orientation orientation, int role) const {
  if (orientation != Qt::Horizontal) return {};
  if (role == Qt::TextAlignmentRole)
    return static_cast<int>(
        (section == frames_column || section == files_column ? Qt::AlignHCenter : Qt::AlignLeft) |
        Qt::AlignVCenter);
  if (role != Qt::DisplayRole) return {};
  const QString titles[] = {tr("Series"),  tr("Kind"), tr("Size"), tr("Frames"),
                            tr("Spacing"), tr("Date"), tr("Files")};
  return section >= 0 && section < column_count ? titles[section] : QVariant();
}

Qt::ItemFlags SeriesModel::flags(const QModelIndex& index) const {
  if (!index.isValid()) return Qt::NoItemFlags;
  if (series_at(index) == nullptr) return Qt::ItemIsEnabled;
  Qt::ItemFlags flags = Qt::ItemNeverHasChildren;
  if (opens(index)) flags |= Qt::ItemIsEnabled | Qt::ItemIsSelectable;
  return flags;
}

}  // namespace palpate::gui
