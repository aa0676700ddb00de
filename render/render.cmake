# Pictures through Cairo and, in space, VTK, without a display. Included by the top file where
# ABBE_RENDER is ON; the definition ABBE_RENDER=1 reaches whoever links abbe::render, so
# `#if ABBE_RENDER` guards its use.
find_package(VTK 9 REQUIRED COMPONENTS CommonCore CommonDataModel IOCore IOImage IOXML RenderingCore RenderingOpenGL2)
find_package(OpenGL REQUIRED COMPONENTS EGL)
find_package(ZLIB REQUIRED)
find_package(PNG REQUIRED)
find_package(Fontconfig REQUIRED)
find_package(Freetype REQUIRED)
find_path(ABBE_CAIRO_HEADERS cairo-ft.h PATH_SUFFIXES cairo REQUIRED)
find_library(ABBE_CAIRO cairo REQUIRED)

abbe_module(render HEADERS patient_headers DEPENDS abbe::cutting
            PRIVATE ${VTK_LIBRARIES} ${ABBE_CAIRO} Fontconfig::Fontconfig PNG::PNG TBB::tbb OpenGL::EGL ZLIB::ZLIB fmt::fmt
                    $<BUILD_INTERFACE:Freetype::Freetype>)
target_include_directories(abbe_render PRIVATE ${ABBE_CAIRO_HEADERS})
get_target_property(abbe_render_sources abbe_render SOURCES)
list(FILTER abbe_render_sources EXCLUDE REGEX "/glew_init\\.cpp$")
set_property(TARGET abbe_render PROPERTY SOURCES ${abbe_render_sources})
target_compile_definitions(abbe_render PUBLIC ABBE_RENDER=1)
vtk_module_autoinit(TARGETS abbe_render MODULES ${VTK_LIBRARIES})

# An object, not a member of the archive: it must be in the executable itself to stand before the
# library's own glewInit.
add_library(abbe_glew_init OBJECT ${CMAKE_CURRENT_LIST_DIR}/glew_init.cpp)
target_link_libraries(abbe_glew_init PRIVATE $<BUILD_INTERFACE:abbe_flags>)
set_target_properties(abbe_glew_init PROPERTIES EXPORT_NAME glew_init)
target_sources(abbe_render INTERFACE $<BUILD_INTERFACE:$<TARGET_OBJECTS:abbe_glew_init>>
                                     $<INSTALL_INTERFACE:$<TARGET_OBJECTS:abbe::glew_init>>)
target_link_libraries(abbe_render INTERFACE ${CMAKE_DL_LIBS})
