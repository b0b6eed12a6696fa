#pragma once

namespace palpate::compute {

/// The whole of palpate-probe: lists the devices of the drivers that it is
/// told of and runs a trivial kernel on each, one line of JSON a message, on
/// file descriptor 3 where there is one, else on standard output. A driver may
/// end it; that is what it is for. `--skip 0,2`: devices that are only listed.
/// Returns 0 when it came to its end.
int probe_main(int argc, char** argv);

}  // namespace palpate::compute
