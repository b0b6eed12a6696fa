// Parses one file in a process of its own, which the file may end (docs/house.md).
#include "palpate/imaging/reader.hpp"

int main(int argc, char** argv) { return palpate::imaging::reader_main(argc, argv); }
