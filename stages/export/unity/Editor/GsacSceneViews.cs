using UnityEditor;
using UnityEngine;

namespace Gsac
{
    /// <summary>Has avatars drawn in the editor's scene views too, sorted anew when such a view is turned.</summary>
    [InitializeOnLoad]
    static class GsacSceneViews
    {
        static GsacSceneViews()
        {
            SceneView.duringSceneGui += Watch;
        }

        static void Watch(SceneView view)
        {
            Camera camera = view.camera;
            if (camera == null) return;
            for (int i = GsacRenderer.ExtraCameras.Count - 1; i >= 0; i--)
            {
                if (GsacRenderer.ExtraCameras[i] == null) GsacRenderer.ExtraCameras.RemoveAt(i);
            }
            bool known = GsacRenderer.ExtraCameras.Contains(camera);
            if (!known) GsacRenderer.ExtraCameras.Add(camera);
            if (Application.isPlaying || (known && !camera.transform.hasChanged)) return;
            camera.transform.hasChanged = false;
            EditorApplication.QueuePlayerLoopUpdate();
        }
    }
}
