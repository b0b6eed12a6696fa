#pragma once

#include <QAbstractButton>
#include <QScrollArea>
#include <QVector>

namespace palpate::gui {

/// The head of a step: its number, title, result in one line, and a check mark
/// when it is done.
class StepHeader : public QAbstractButton {
  Q_OBJECT

 public:
  StepHeader(int number, const QString& title, QWidget* parent);
  void set_result(const QString& result, bool done);
  bool done() const { return done_; }
  const QString& result() const { return result_; }
  QSize sizeHint() const override;

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  void name_for_readers();
  int number_;
  QString result_;
  bool done_ = false;
};

/// The steps Data, Filter, Tissue, Simulate, Picture as an accordion.
class SidePanel : public QScrollArea {
  Q_OBJECT

 public:
  explicit SidePanel(QWidget* parent = nullptr);
  /// `id` names the header: "data" gives dataHeader.
  void add_step(const QString& id, const QString& title, QWidget* body);
  void open_step(int step);
  int open_step() const { return open_; }
  StepHeader& header(int step) const { return *headers_[step]; }

 protected:
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  QWidget* contents_;
  QVector<StepHeader*> headers_;
  QVector<QWidget*> bodies_;
  int open_ = -1;
};

/// The steps by their place in the panel.
namespace steps {
enum Step { data, filter, tissue, simulate, picture };
}

}  // namespace palpate::gui
