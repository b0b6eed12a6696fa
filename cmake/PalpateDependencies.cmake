# Everything comes from the distribution's packages; see scripts/packages.
find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(OpenCL REQUIRED)
find_package(nlohmann_json 3 REQUIRED)
find_package(OpenSSL 3 REQUIRED COMPONENTS Crypto)
find_package(VTK 9.1 REQUIRED COMPONENTS
  ChartsCore CommonCore CommonDataModel CommonExecutionModel CommonMath CommonTransforms
  FiltersCore FiltersGeneral FiltersGeometry FiltersModeling FiltersSources
  IOGeometry IOImage IOLegacy IOPLY IOXML
  ImagingCore InteractionStyle
  RenderingAnnotation RenderingContext2D RenderingContextOpenGL2 RenderingCore RenderingFreeType RenderingOpenGL2)
if(PALPATE_BUILD_GUI)
  find_package(VTK 9.1 REQUIRED COMPONENTS GUISupportQt)
  # VTK decides the Qt version: 5 on Debian 12, 6 where it was built so.
  if(NOT VTK_QT_VERSION)
    set(VTK_QT_VERSION 5)
  endif()
  set(PALPATE_QT "Qt${VTK_QT_VERSION}")
  find_package(${PALPATE_QT} REQUIRED COMPONENTS Core Gui Widgets Svg)
endif()
if(PALPATE_BUILD_TESTS)
  find_package(GTest REQUIRED)
  include(GoogleTest)
  set(PALPATE_TEST_DATA "${CMAKE_SOURCE_DIR}/../shared/data" CACHE PATH
    "Folder of scans for the tests; tests that need it are skipped where it is missing")
endif()
