// A fixture of the rule test: core must not know imaging.
#include "palpate/imaging/reader.hpp"
