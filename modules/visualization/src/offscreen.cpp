#include "offscreen.hpp"

#include "palpate/core/error.hpp"

#include <vtkCallbackCommand.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkRenderer.h>
#include <vtkRendererCollection.h>
#include <vtkUnsignedCharArray.h>

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <cstdio>
#include <cstring>
#include <exception>
#include <mutex>
#include <thread>

namespace palpate::visualization {
namespace {

// Asked for by name, as EGL hands it out; the GL library itself is not linked.
constexpr unsigned gl_renderer = 0x1F01;
constexpr unsigned depth_less_or_equal = 0x0203;

[[noreturn]] void no_renderer(const std::string& details) {
  throw core::Error(
      core::ErrorKind::internal, "no-renderer",
      "Pictures cannot be drawn: no OpenGL driver that draws without a window was found. Install "
      "Mesa's EGL driver (libegl-mesa0 and libgl1-mesa-dri) or the graphics card's own driver.",
      details);
}

std::string egl_error(const char* call) {
  char text[96];
  std::snprintf(text, sizeof text, "%s failed (EGL error 0x%04x)", call,
                static_cast<unsigned>(eglGetError()));
  return text;
}

/// The surfaceless platform first (Mesa, with or without a graphics card), then
/// the first device, then whatever EGL takes as its default. A display belongs
/// to the process and is not ended here: others may use the same one.
EGLDisplay open_display(std::string& complaints) {
  const auto get_platform_display =
      reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
  const auto query_devices =
      reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  std::vector<EGLDisplay> candidates;
  if (get_platform_display != nullptr) {
    candidates.push_back(get_platform_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
    EGLDeviceEXT device = nullptr;
    EGLint count = 0;
    if (query_devices != nullptr && query_devices(1, &device, &count) == EGL_TRUE && count > 0)
      candidates.push_back(get_platform_display(EGL_PLATFORM_DEVICE_EXT, device, nullptr));
  }
  candidates.push_back(eglGetDisplay(EGL_DEFAULT_DISPLAY));
  for (EGLDisplay display : candidates) {
    if (display == EGL_NO_DISPLAY) continue;
    if (eglInitialize(display, nullptr, nullptr) == EGL_TRUE) return display;
    complaints += egl_error("eglInitialize") + "; ";
  }
  return EGL_NO_DISPLAY;
}

/// A GL 3.2 core context, current without a surface while it lives.
class EglContext {
 public:
  EglContext() {
    std::string complaints;
    display_ = open_display(complaints);
    if (display_ == EGL_NO_DISPLAY) no_renderer(complaints);
    if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) no_renderer(complaints + egl_error("eglBindAPI"));
    const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    if (eglChooseConfig(display_, wanted, &config, 1, &count) != EGL_TRUE || count == 0)
      no_renderer(complaints + egl_error("eglChooseConfig"));
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION,
                              3,
                              EGL_CONTEXT_MINOR_VERSION,
                              2,
                              EGL_CONTEXT_OPENGL_PROFILE_MASK,
                              EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                              EGL_NONE};
    context_ = eglCreateContext(display_, config, EGL_NO_CONTEXT, version);
    if (context_ == EGL_NO_CONTEXT) no_renderer(complaints + egl_error("eglCreateContext"));
    if (eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) != EGL_TRUE) {
      const std::string reason = egl_error("eglMakeCurrent");
      eglDestroyContext(display_, context_);
      no_renderer(complaints + reason);
    }
    // VTK draws over what lies at the same depth; GL starts the other way.
    using SetDepthFunction = void (*)(unsigned);
    const auto set_depth_function = reinterpret_cast<SetDepthFunction>(eglGetProcAddress("glDepthFunc"));
    if (set_depth_function != nullptr) set_depth_function(depth_less_or_equal);
  }
  ~EglContext() {
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display_, context_);
    eglReleaseThread();
  }
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  static std::string renderer_name() {
    using GetString = const unsigned char* (*)(unsigned);
    const auto get_string = reinterpret_cast<GetString>(eglGetProcAddress("glGetString"));
    const unsigned char* name = get_string != nullptr ? get_string(gl_renderer) : nullptr;
    return name != nullptr ? reinterpret_cast<const char*>(name) : "unknown";
  }

 private:
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
};

/// VTK's GL loader also asks for an X display and calls its work failed where
/// there is none, although the GL functions are loaded by then; VTK would go on
/// without ever asking the driver for its limits.
class CanvasWindow : public vtkGenericOpenGLRenderWindow {
 public:
  static CanvasWindow* New();
  vtkTypeMacro(CanvasWindow, vtkGenericOpenGLRenderWindow) void OpenGLInitContext() override {
    Superclass::OpenGLInitContext();
    Initialized = true;
    GlewInitValid = true;
  }

 protected:
  CanvasWindow() = default;
  ~CanvasWindow() override = default;
};
vtkStandardNewMacro(CanvasWindow)

    /// VTK complains that its loader found no X display and then draws all the
    /// same; an observer takes those words in place of the user's terminal.
    void keep_words(vtkObject* /*caller*/, unsigned long /*event*/, void* words, void* data) {
  if (data != nullptr) *static_cast<std::string*>(words) += static_cast<const char*>(data);
}

}  // namespace

struct OffscreenCanvas::Impl {
  Impl() {
    vtkNew<vtkCallbackCommand> listener;
    listener->SetCallback(keep_words);
    listener->SetClientData(&complaints);
    window->AddObserver(vtkCommand::ErrorEvent, listener);
    window->AddObserver(vtkCommand::WarningEvent, listener);
    window->SetReadyForRendering(true);
    window->SetSupportsOpenGL(1);
    window->SetIsDirect(0);
    window->SetIsCurrent(true);
    window->SetMapped(1);
    window->SetMultiSamples(4);
    window->SetAlphaBitPlanes(1);
    window->SetDPI(72);
    window->SwapBuffersOff();
    window->SetFrameBlitModeToNoBlit();
  }
  ~Impl() { window->Finalize(); }

  EglContext context;
  std::string name = EglContext::renderer_name();
  std::string complaints;
  vtkNew<CanvasWindow> window;
};

OffscreenCanvas::OffscreenCanvas() : impl_(std::make_unique<Impl>()) {}
OffscreenCanvas::~OffscreenCanvas() { release(); }

std::string OffscreenCanvas::probe_renderer_name() {
  const EglContext context;
  return EglContext::renderer_name();
}

void OffscreenCanvas::release() {
  vtkRendererCollection* renderers = impl_->window->GetRenderers();
  while (vtkRenderer* renderer = renderers->GetFirstRenderer()) impl_->window->RemoveRenderer(renderer);
}

std::vector<std::uint8_t> OffscreenCanvas::draw(vtkRenderer& renderer, int width_px, int height_px) {
  vtkGenericOpenGLRenderWindow* window = impl_->window;
  window->SetSize(width_px, height_px);
  if (window->HasRenderer(&renderer) == 0) {
    release();
    window->AddRenderer(&renderer);
  }
  window->Render();
  vtkNew<vtkUnsignedCharArray> pixels;
  const int got = window->GetRGBACharPixelData(0, 0, width_px - 1, height_px - 1, 0, pixels);
  const auto bytes = static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px) * 4;
  if (got != VTK_OK || static_cast<std::size_t>(pixels->GetNumberOfValues()) < bytes)
    no_renderer(impl_->name + ": " + impl_->complaints);
  std::vector<std::uint8_t> rgba(bytes);
  std::memcpy(rgba.data(), pixels->GetPointer(0), bytes);
  return rgba;
}

void on_own_thread(const std::function<void()>& work) {
  static std::mutex one_at_a_time;
  const std::lock_guard<std::mutex> lock(one_at_a_time);
  std::exception_ptr failure;
  std::thread thread([&] {
    try {
      work();
    } catch (...) {
      failure = std::current_exception();
    }
  });
  thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace palpate::visualization
