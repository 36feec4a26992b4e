// Stands for Unity's scenes. API.md: pages and versions.
using System.Collections.Generic;

namespace UnityEngine.SceneManagement
{
    public struct Scene
    {
        /// <summary>Not Unity's: what stands in the scene.</summary>
        public List<GameObject> Roots;
        public GameObject[] GetRootGameObjects() { return Roots.ToArray(); }
    }
}
