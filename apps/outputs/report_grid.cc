#include <plumbline/core/error.h>
#include <plumbline/outputs/report_grid.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <plumbline/outputs/late_cairo.inc>
#include <string>
#include <vector>

namespace plumbline {
namespace {

// Opaque, red, green, blue.
constexpr std::uint32_t kOccupiedPixel = 0xff6b7682;
constexpr std::uint32_t kFreePixel = 0xffeef1f4;

// Pixels by rows, the upper one first: 0 where it is clear, otherwise opaque,
// 0xffRRGGBB.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint32_t> pixels;
};

struct SurfaceDeleter {
  void operator()(cairo_surface_t* s) const { cairo_surface_destroy(s); }
};

cairo_status_t Append(void* closure, const unsigned char* data,
                      unsigned int length) {
  static_cast<std::string*>(closure)->append(
      reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

std::string Base64(const std::string& bytes) {
  constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      three <<= 8;
      if (i + k < bytes.size()) {
        three |= static_cast<unsigned char>(bytes[i + k]);
      }
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text +=
          i + k <= bytes.size() ? kDigits[(three >> (18 - 6 * k)) & 63] : '=';
    }
  }
  return text;
}

std::string PngInBase64(const Picture& picture) {
  const std::unique_ptr<cairo_surface_t, SurfaceDeleter> surface(
      cairo_image_surface_create(CAIRO_FORMAT_ARGB32, picture.width,
                                 picture.height));
  if (picture.pixels.empty() ||
      cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS) {
    throw PLUMBLINE_ERROR("a picture of " + std::to_string(picture.width) +
                              " x " + std::to_string(picture.height),
                          "one that cairo can make");
  }
  cairo_surface_flush(surface.get());
  unsigned char* const data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  const std::size_t row_size =
      static_cast<std::size_t>(picture.width) * sizeof(std::uint32_t);
  for (int row = 0; row < picture.height; ++row) {
    std::memcpy(data + static_cast<std::ptrdiff_t>(row) * stride,
                picture.pixels.data() +
                    static_cast<std::ptrdiff_t>(row) * picture.width,
                row_size);
  }
  cairo_surface_mark_dirty(surface.get());
  std::string png;
  if (cairo_surface_write_to_png_stream(surface.get(), Append, &png) !=
      CAIRO_STATUS_SUCCESS) {
    throw PLUMBLINE_ERROR("a picture that cannot be written", "memory");
  }
  return Base64(png);
}

}  // namespace

ReportGrid MakeReportGrid(const OccupancyGrid& grid, double most_pixels) {
  int cells = 1;
  while (static_cast<double>(grid.width()) * grid.height() /
             (static_cast<double>(cells) * cells) >
         most_pixels) {
    ++cells;
  }
  Picture picture;
  picture.width = (grid.width() + cells - 1) / cells;
  picture.height = (grid.height() + cells - 1) / cells;
  picture.pixels.assign(static_cast<std::size_t>(picture.width) *
                            static_cast<std::size_t>(picture.height),
                        0);
  grid.VisitKnown([&](int column, int row, std::uint8_t value) {
    // The first row of a picture is the upper one.
    std::uint32_t& pixel =
        picture
            .pixels[static_cast<std::size_t>(picture.height - 1 - row / cells) *
                        static_cast<std::size_t>(picture.width) +
                    static_cast<std::size_t>(column / cells)];
    if (value == OccupancyGrid::kOccupied) {
      pixel = kOccupiedPixel;
    } else if (pixel == 0) {
      pixel = kFreePixel;
    }
  });
  return {grid.origin(), grid.resolution() * cells, picture.width,
          picture.height, PngInBase64(picture)};
}

}  // namespace plumbline
