#ifndef PLUMBLINE_OUTPUTS_REPORT_PICTURE_H_
#define PLUMBLINE_OUTPUTS_REPORT_PICTURE_H_

#include <cstdint>
#include <string>
#include <vector>

namespace plumbline {

/// Pixels by rows, the upper one first: 0 where it is clear, otherwise opaque,
/// 0xffRRGGBB.
struct ReportPicture {
  int width = 0;
  int height = 0;
  std::vector<std::uint32_t> pixels;
};

/// The picture as PNG in base64 (RFC 4648), for a page. Throws Error when it is
/// empty, or too large to be one.
std::string PngInBase64(const ReportPicture& picture);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_REPORT_PICTURE_H_
