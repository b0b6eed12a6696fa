// palpate [FILE|FOLDER]: the window.
#include "main_window.hpp"
#include "theme.hpp"

#include <QApplication>
#include <QCommandLineParser>
#include <QDir>
#include <QFileInfo>

namespace {

// Beside an installed program, else in the source tree that this was built from.
QString find_sample() {
  const QDir here(QCoreApplication::applicationDirPath());
  for (const QString& path : {here.filePath(QStringLiteral("../share/palpate/sample-heart.mha")),
                              QStringLiteral(PALPATE_SOURCE_DATA "/sample-heart.mha")}) {
    if (QFileInfo::exists(path)) return QFileInfo(path).canonicalFilePath();
  }
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  palpate::gui::prepare_application();
  QApplication application(argc, argv);
  QApplication::setApplicationName(QStringLiteral("Palpate"));
  QApplication::setOrganizationName(QStringLiteral("Palpate"));
  QApplication::setApplicationVersion(QStringLiteral(PALPATE_VERSION));

  QCommandLineParser parser;
  parser.setApplicationDescription(
      QStringLiteral("Turns an ultrasound volume into tissue that can be pulled."));
  parser.addHelpOption();
  parser.addVersionOption();
  parser.addOption({QStringLiteral("sample"), QStringLiteral("Opens the sample heart.")});
  parser.addOption({QStringLiteral("device"),
                    QStringLiteral("OpenCL device by number or name, or \"reference\"."),
                    QStringLiteral("DEVICE")});
  parser.addPositionalArgument(QStringLiteral("scan"), QStringLiteral("A file, or a folder of one series."),
                               QStringLiteral("[scan]"));
  parser.process(application);

  palpate::gui::apply_theme(application);
  palpate::gui::WindowOptions options;
  options.sample_file = find_sample();
  options.device = parser.value(QStringLiteral("device"));
  palpate::gui::MainWindow window(options);
  window.show();
  if (!parser.positionalArguments().isEmpty()) {
    window.open(parser.positionalArguments().constFirst());
  } else if (parser.isSet(QStringLiteral("sample"))) {
    window.open_sample();
  }
  return QApplication::exec();
}
