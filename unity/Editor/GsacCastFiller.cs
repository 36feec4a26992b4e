using System.Collections.Generic;
using UnityEditor;
using UnityEditor.Build;
using UnityEditor.Build.Reporting;
using UnityEngine;
using UnityEngine.SceneManagement;

namespace Gsac
{
    /// <summary>Finds the people of the project for scenes that name none, and names them in the scenes of a player.</summary>
    [InitializeOnLoad]
    public sealed class GsacCastFiller : IProcessSceneWithReport
    {
        static GsacCastFiller()
        {
            GsacCast.FindPeople = FindPeople;
        }

        public int callbackOrder { get { return 0; } }

        /// <summary>In the order of their paths.</summary>
        public static GsacAvatar[] FindPeople()
        {
            var paths = new List<string>();
            foreach (string guid in AssetDatabase.FindAssets("t:GsacAsset")) paths.Add(AssetDatabase.GUIDToAssetPath(guid));
            paths.Sort(string.CompareOrdinal);
            var people = new List<GsacAvatar>();
            foreach (string path in paths)
            {
                var prefab = AssetDatabase.LoadAssetAtPath<GameObject>(path);
                if (prefab != null && prefab.GetComponent<GsacAvatar>() != null) people.Add(prefab.GetComponent<GsacAvatar>());
            }
            return people.ToArray();
        }

        /// <summary>report: null where it is no player that is built.</summary>
        public void OnProcessScene(Scene scene, BuildReport report)
        {
            if (report == null) return;
            foreach (GameObject root in scene.GetRootGameObjects())
            {
                foreach (GsacCast cast in root.GetComponentsInChildren<GsacCast>(true))
                {
                    if (cast.People.Length == 0) cast.People = FindPeople();
                }
            }
        }
    }
}
