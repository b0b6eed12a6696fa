#include "palpate/imaging/phantom.hpp"

#include <gtest/gtest.h>
