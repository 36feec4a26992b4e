using System.Collections;
using NUnit.Framework;
using UnityEngine;
using UnityEngine.TestTools;

namespace Gsac.Tests
{
    /// <summary>The first person of the project is drawn as the file asks; without one there is nothing to look at.</summary>
    public sealed class GsacPictureTests
    {
        const float Least = 28; // dB: what blending in linear colours leaves, and more

        [UnityTest]
        public IEnumerator APersonIsDrawnAsTheFileAsks()
        {
            var cast = new GameObject("People").AddComponent<GsacCast>();
            if (cast.First == null) Assert.Ignore("nobody in this project: drag an avatar.gsac into it");
            for (int i = 0; i < 10; i++) yield return null;
            foreach (GsacCheckedView view in GsacSelfCheck.Look(cast.First))
            {
                Assert.Greater(view.DrawnShare, view.PersonShare / 2, view.Name + ": nobody is seen");
                Assert.Greater(view.Decibels, Least, view.Name);
            }
            Object.Destroy(cast.gameObject);
        }
    }
}
