// palpate [FILE|FOLDER]: the window.
#include "main_window.hpp"
#include "theme.hpp"

#include "palpate/compute/driver_threads.hpp"

#include <QApplication>
#include <QCommandLineParser>
#include <QDir>
#include <QFileInfo>

#include <algorithm>
#include <string>

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

void name_program() {
  QCoreApplication::setApplicationName(QStringLiteral("Palpate"));
  QCoreApplication::setOrganizationName(QStringLiteral("Palpate"));
  QCoreApplication::setApplicationVersion(QStringLiteral(PALPATE_VERSION));
}

void describe(QCommandLineParser& parser) {
  parser.setApplicationDescription(
      QStringLiteral("Turns an ultrasound volume into tissue that can be pulled."));
  parser.addHelpOption();
  parser.addVersionOption();
  parser.addOption({QStringLiteral("sample"), QStringLiteral("Opens the sample heart.")});
  parser.addOption({QStringLiteral("device"),
                    QStringLiteral("OpenCL device by number or name, or \"reference\"."),
                    QStringLiteral("DEVICE")});
  parser.addPositionalArgument(QStringLiteral("scan"), QStringLiteral("A file, a folder, or a session."),
                               QStringLiteral("[scan]"));
}

bool asks_for_words(int argc, char** argv) {
  return std::any_of(argv + 1, argv + argc, [](const std::string& word) {
    return word == "--help" || word == "-h" || word == "--help-all" || word == "--version" || word == "-v";
  });
}

}  // namespace

int main(int argc, char** argv) {
  name_program();
  QCommandLineParser parser;
  describe(parser);
  if (asks_for_words(argc, argv)) {
    // Answered without a display.
    const QCoreApplication application(argc, argv);
    parser.process(application);
    return 0;
  }
  palpate::compute::bind_driver_threads();
  palpate::gui::prepare_application();
  QApplication application(argc, argv);
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
  const int code = QApplication::exec();
  QGuiApplication::sync();  // the window is gone from the screen before threads are waited for
  return code;
}
