using UnityEditor;
using UnityEditor.SceneManagement;
using UnityEngine;

namespace Gsac
{
    /// <summary>Keeps avatars out of previews and prefab stages that are not theirs, and hidden ones out of scene views.</summary>
    [InitializeOnLoad]
    static class GsacSceneViews
    {
        static GsacSceneViews()
        {
            GsacCameras.Shows = Shows;
        }

        static bool Shows(Camera camera, GameObject person)
        {
            if (camera.cameraType == CameraType.SceneView && SceneVisibilityManager.instance.IsHidden(person)) return false;
            return StageUtility.IsGameObjectRenderedByCamera(person, camera);
        }
    }
}
