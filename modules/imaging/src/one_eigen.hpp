#pragma once

// Included before everything else in files that see ITK (CMakeLists.txt).
// ITK brings its own copy of Eigen, whose macros clash with the Eigen of this
// project; this points its headers at ours. Nothing else of ITK's uses Eigen.
#define itk_eigen_h
#define ITK_EIGEN(header) <Eigen/header>
