using System.Collections.Generic;
using UnityEditor;
using UnityEngine;

namespace Gsac
{
    /// <summary>Has avatars drawn in the editor's scene views too, sorted anew when such a view is turned.</summary>
    [InitializeOnLoad]
    static class GsacSceneViews
    {
        static readonly Dictionary<Camera, Matrix4x4> Seen = new Dictionary<Camera, Matrix4x4>();

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
            if (!GsacRenderer.ExtraCameras.Contains(camera)) GsacRenderer.ExtraCameras.Add(camera);
            // an update draws the view again: only where it moved, or it would never rest
            Matrix4x4 before, now = camera.transform.localToWorldMatrix;
            if (Application.isPlaying || (Seen.TryGetValue(camera, out before) && before.Equals(now))) return;
            Seen[camera] = now;
            EditorApplication.QueuePlayerLoopUpdate();
        }
    }
}
