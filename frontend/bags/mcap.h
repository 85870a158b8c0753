#ifndef PLUMBLINE_FRONTEND_BAGS_MCAP_H_
#define PLUMBLINE_FRONTEND_BAGS_MCAP_H_

#include <plumbline/frontend/bags/bag_source.h>
#include <plumbline/frontend/input_stream.h>

#include <memory>
#include <string_view>

namespace plumbline {

/// Whether bytes that start with `prefix` are an MCAP file.
bool LooksLikeMcap(std::string_view prefix);

/// The messages of an MCAP file (mcap.dev/spec), chunks plain, lz4 or zstd, or
/// none at all. The file is read from its beginning to the end of its data: the
/// index is neither needed nor trusted. A chunk whose checksum is wrong is
/// passed over whole. `input` must outlive the source.
std::unique_ptr<BagSource> OpenMcap(InputStream* input);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_MCAP_H_
